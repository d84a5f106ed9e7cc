//! Comparison of the calibrated simulation with the measurements.

use maud::{Markup, html};

use super::headline::case_title;
use super::{coordinate_unit, drawn, group_word, residuals, response_label, response_unit};
use crate::page::chart::{
    Axis, Band, BarChart, BarSeries, Curve, Key, Panel, Row, row_chart, small_multiples,
};
use crate::page::curves::{CurvePanel, Curves};
use crate::page::number::{decimals, fixed, percent, significant};
use crate::page::scale::{ShownUnit, extent, padded};
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section};
use crate::report::findings::Findings;
use crate::stage::validate::{ValidationCase, ValidationFindings};

/// The validation; `None` if there is none.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let validation = findings.validation.as_ref()?;
    let content = html! {
        @if !validation.cases.is_empty() {
            (points(findings, validation, numbers))
            (curves(findings, validation, numbers))
            (residuals::map(findings, validation, numbers))
            (drawn::figure(findings, validation, numbers))
            @if validation.cases.iter().any(|case| !case.accuracy.is_empty()) {
                (accuracy(findings, validation, numbers))
            }
        }
        @if !validation.spread.is_empty() { (spread(findings, validation, numbers)) }
    };
    Some(Section { id: "validation", title: "Calibrated simulation", content })
}

/// CSS classes of the cases; the first is that of the calibrated one.
const CLASSES: [(&str, &str); 4] = [
    ("s-map", "b-map"),
    ("s-reference", "b-reference"),
    ("s-third", "b-third"),
    ("s-fourth", "b-fourth"),
];

fn classes(i: usize) -> (&'static str, &'static str) {
    CLASSES[i.min(CLASSES.len() - 1)]
}

fn points(findings: &Findings, validation: &ValidationFindings, numbers: &mut Numbers) -> Markup {
    let columns: Vec<(String, ShownUnit, usize)> =
        (0..findings.parameters.len()).map(|i| point_column(findings, validation, i)).collect();
    let difference = response_unit(findings).label("RMSE");
    let mut heads: Vec<&str> = columns.iter().map(|(label, ..)| label.as_str()).collect();
    heads.push(&difference);
    let mut table = Table::new(&["parameters", "response"], &heads);
    for case in &validation.cases {
        let how = if case.simulated { "simulated" } else { "emulated" };
        let mut cells = vec![case_title(&case.name).to_owned(), how.to_owned()];
        let values = case.point.iter().zip(&columns);
        cells.extend(values.map(|(&v, (_, unit, decimals))| fixed(unit.show(v), *decimals)));
        cells.push(significant(response_unit(findings).show(case.rmse), 3));
        table.row(cells);
    }
    let caption = Caption::new(
        "What is compared with the measurements; RMSE is the root mean square difference from the \
         replicates' mean over all outputs.",
        "",
        "an emulated response: the model itself was not run there.",
    );
    numbers.table(&table, &caption)
}

/// Label, displayed unit and decimals of one parameter, those of the posterior if there is one.
fn point_column(
    findings: &Findings,
    validation: &ValidationFindings,
    i: usize,
) -> (String, ShownUnit, usize) {
    let parameter = &findings.parameters[i];
    let coordinate = findings.calibration.as_ref().and_then(|c| c.coordinates.get(i));
    let values = validation.cases.iter().filter_map(|case| case.point.get(i).copied());
    let (unit, places) = if let Some(c) = coordinate {
        let unit = coordinate_unit(c);
        let places = decimals(unit.show(c.mcse_mean), unit.show(c.sd));
        (unit, places)
    } else {
        let unit = ShownUnit::for_values(&parameter.unit, values.clone());
        let spread = extent(values.map(|v| unit.show(v))).map_or(0.0, |(low, high)| high - low);
        (unit, decimals(f64::NAN, spread))
    };
    (unit.label(&parameter.name), unit, places)
}

fn curves(findings: &Findings, validation: &ValidationFindings, numbers: &mut Numbers) -> Markup {
    let outlines = Curves::of(&findings.layouts);
    let unit = response_unit(findings);
    let panels: Vec<Panel> =
        outlines.panels.iter().map(|outline| panel(validation, outline, &unit)).collect();
    let lines = panels.iter().flat_map(|p| p.curves.iter().flat_map(|c| c.points.iter()));
    let edges = panels.iter().flat_map(|p| p.bands.iter().flat_map(|b| b.edges.iter()));
    let values = lines.map(|p| p.1).chain(edges.flat_map(|e| [e.1, e.2]));
    let x = Axis::new(outlines.label.as_str(), outlines.domain).ticks(6);
    let range = padded(extent(values).unwrap_or((0.0, 1.0)), 0.06);
    let y = Axis::new(response_label(findings), range).ticks(4);
    let repeated = validation.replicates.iter().any(|(count, ..)| *count > 1);
    let mut keys = if repeated {
        vec![
            Key::line("s-mean", "mean of the replicates"),
            Key::area("s-band", "replicates' 95 % interval (mean ± 1.96 sd)"),
        ]
    } else {
        vec![Key::line("s-mean", "measured")]
    };
    for (i, case) in validation.cases.iter().enumerate() {
        let how = if case.simulated { "simulated" } else { "emulated" };
        keys.push(Key::line(classes(i).0, format!("{how} at the {}", case_title(&case.name))));
    }
    if validation.predictive.is_some() {
        keys.push(Key::line("s-predictive", "posterior predictive 95 %"));
    }
    let (shows, bands) = if repeated {
        let shows = "Each group's mean of the replicates with their 95 % interval, and the responses at the \
             compared parameters; accuracies (share of points inside the interval) above each panel.";
        let bands = "the grey band is of the replicates; the dotted lines enclose the posterior predictive of a \
             new replicate.";
        (shows, bands)
    } else {
        let shows =
            "What was measured in each group, and the responses at the compared parameters.";
        (shows, "the dotted lines enclose the posterior predictive of a new replicate.")
    };
    let caption = Caption::new(
        format!("{shows}{}", outlines.left_out_sentence()),
        bands,
        "stretches where the calibrated curve leaves the data on one side: structured disagreement \
         that no choice of these parameters removes.",
    );
    let drawing = small_multiples(&panels, &x, &y, "calibrated simulation against measurements");
    numbers.figure("validation", &drawing, &keys, &caption)
}

fn panel(validation: &ValidationFindings, outline: &CurvePanel, unit: &ShownUnit) -> Panel {
    let replicates = |i: usize| validation.replicates.get(i).copied().filter(|r| r.0 > 0);
    let mean = |i: usize| replicates(i).map_or(f64::NAN, |r| unit.show(r.1));
    let interval = |i: usize| {
        let (_, mean, sd) = replicates(i).filter(|r| r.0 > 1)?;
        Some((unit.show(mean - 1.96 * sd), unit.show(mean + 1.96 * sd)))
    };
    let mut curves = Vec::new();
    if let Some((low, high)) = &validation.predictive {
        for (edge, name) in [(low, "predictive 2.5 %"), (high, "predictive 97.5 %")] {
            let value = |i: usize| unit.show(edge.get(i).copied().unwrap_or(f64::NAN));
            let points = outline.curve(value);
            curves.push(Curve { class: "s-predictive", name: name.to_owned(), points });
        }
    }
    curves.push(Curve { class: "s-mean", name: "mean".to_owned(), points: outline.curve(mean) });
    // Cases are drawn in reverse order, so that the calibrated curve lies on top.
    for (i, case) in validation.cases.iter().enumerate().rev() {
        let value = |i: usize| unit.show(case.response.get(i).copied().unwrap_or(f64::NAN));
        let name = case_title(&case.name).to_owned();
        curves.push(Curve { class: classes(i).0, name, points: outline.curve(value) });
    }
    let accuracies = validation.cases.iter().filter_map(|case| {
        let share = case.accuracy.iter().find(|(group, _)| *group == outline.title)?.1;
        Some(format!("{} {}", case_title(&case.name), percent(share)))
    });
    Panel {
        title: outline.title.clone(),
        remark: accuracies.collect::<Vec<_>>().join(" · "),
        bands: vec![Band { class: "s-band", edges: outline.band(interval) }],
        curves,
    }
}

/// Table of the accuracy of every case in every group, in percent.
pub fn accuracy_table(group: &str, cases: &[ValidationCase]) -> Table {
    let heads: Vec<String> =
        cases.iter().map(|case| format!("{} [%]", case_title(&case.name))).collect();
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let mut table = Table::new(&[group], &heads);
    for group in group_names(cases) {
        let shares = cases.iter().map(|case| share(case, &group));
        let cells = shares.map(|s| fixed(100.0 * s, 1)).collect::<Vec<_>>();
        table.row([group].into_iter().chain(cells));
    }
    let averages = cases.iter().map(|case| fixed(100.0 * case.average, 1));
    table.emphasised([String::from("average")].into_iter().chain(averages));
    table
}

/// Groups of all cases, in the order of their first occurrence.
fn group_names(cases: &[ValidationCase]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for (name, _) in cases.iter().flat_map(|case| &case.accuracy) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    names
}

fn share(case: &ValidationCase, group: &str) -> f64 {
    case.accuracy.iter().find(|(name, _)| name == group).map_or(f64::NAN, |(_, share)| *share)
}

fn accuracy(findings: &Findings, validation: &ValidationFindings, numbers: &mut Numbers) -> Markup {
    let cases = &validation.cases;
    let names = group_names(cases);
    let series = cases.iter().enumerate().map(|(i, case)| BarSeries {
        class: classes(i).1,
        name: case_title(&case.name).to_owned(),
        values: names.iter().map(|group| 100.0 * share(case, group)).collect(),
    });
    let chart = BarChart {
        series: series.collect(),
        levels: Vec::new(),
        x_label: group_word(&findings.layouts).to_owned(),
        y: Axis::new("points inside the interval [%]", (0.0, 108.0)).ticks(6),
        outstanding: Vec::new(),
        numbers: names.len() * cases.len() <= 30,
        names,
    };
    let keys: Vec<Key> = cases
        .iter()
        .enumerate()
        .map(|(i, case)| Key::area(classes(i).1, case_title(&case.name)))
        .collect();
    let caption = Caption::new(
        "Accuracy of every group: the share of points at which the response lies inside the \
         replicates' 95 % interval.",
        "the interval is of the replicates.",
        "groups that calibration made worse, and groups that no parameters bring inside.",
    );
    let table_caption =
        Caption::new("The same accuracies as numbers, with their mean over the groups.", "", "");
    html! {
        (numbers.figure("accuracy", &[chart.draw("accuracy of every group")], &keys, &caption))
        (numbers.table(&accuracy_table(group_word(&findings.layouts), cases), &table_caption))
    }
}

fn spread(findings: &Findings, validation: &ValidationFindings, numbers: &mut Numbers) -> Markup {
    let unit = response_unit(findings);
    let total: f64 = validation.spread.iter().map(|(_, sd)| sd * sd).sum();
    let mut rows: Vec<Row> = validation
        .spread
        .iter()
        .map(|(origin, sd)| Row {
            name: origin.clone(),
            value: sd * sd,
            text: format!(
                "sd {} · {} of the variance",
                unit.text(*sd, 3),
                percent(sd * sd / total)
            ),
        })
        .collect();
    rows.push(Row {
        name: String::from("together"),
        value: total,
        text: format!("sd {}", unit.text(total.sqrt(), 3)),
    });
    let caption = Caption::new(
        "What a new replicate would vary by, split by origin: bars are shares of the variance, root \
         mean square over the outputs; standard deviations are in the response's unit and do not add.",
        "posterior predictive of one new replicate.",
        "a large part of the discrepancy: the model misses something. A large part of the emulator: \
         more runs would help.",
    );
    let drawing = row_chart(&rows, "bar s-part", "variance of a new replicate by origin");
    numbers.figure("spread", &[drawing], &[], &caption)
}
