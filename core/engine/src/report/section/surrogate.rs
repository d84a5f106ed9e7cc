//! The surrogate and its errors.

use lacuna_linalg::Matrix;
use maud::{Markup, html};

use super::forward::LINES;
use super::{fact_list, group_word, main_effects, response_label, response_unit};
use crate::page::chart::{
    Axis, BarChart, BarSeries, Curve, Key, Panel, agreement, small_multiples,
};
use crate::page::curves::{CurvePanel, Curves};
use crate::page::number::{count, significant};
use crate::page::scale::extent;
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section};
use crate::report::findings::{Findings, SurrogateFindings};

/// The surrogate; `None` if there is none.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let surrogate = findings.surrogate.as_ref()?;
    let unit = response_unit(findings);
    let content = html! {
        p {
            "Trained on " b { (count(surrogate.training)) } " runs and checked on "
            (count(surrogate.validation)) " that it had not seen."
            @if let Some((error, runs)) = surrogate.near_posterior {
                " At " (count(runs)) " posterior draws where the model was run anew its error is "
                b { (unit.text(error, 3)) } " root mean square: this, not the error over the whole \
                design, is what the calibration feels."
            }
        }
        @if let Some((rounds, ratio, of, reached)) = surrogate.refinement {
            p {
                "Refined in " (count(rounds)) " rounds: near the posterior its error is "
                b { (significant(ratio, 2)) } " of " (of)
                @if !reached { ", more than the study wants" } "."
            }
        }
        (fact_list(&surrogate.facts))
        (errors(findings, surrogate, numbers))
        @if !surrogate.pairs.is_empty() { (pairs(findings, surrogate, numbers)) }
        (errors_along(findings, surrogate, numbers))
        (main_effects::figure(findings, surrogate, numbers))
        @if let Some(sobol) = &surrogate.sobol { (sensitivity(findings, sobol, numbers)) }
        @if let Some(total) = &surrogate.total_by_output { (sensitivity_along(findings, total, numbers)) }
    };
    Some(Section { id: "surrogate", title: "Surrogate", content })
}

fn errors(findings: &Findings, surrogate: &SurrogateFindings, numbers: &mut Numbers) -> Markup {
    let unit = response_unit(findings);
    let (mae, rmse) = (unit.label("MAE"), unit.label("RMSE"));
    let mut table =
        Table::new(&[group_word(&findings.layouts)], &[&mae, &rmse, "LOO [share of variance]"]);
    let cells = |name: &str, mae: f64, rmse: f64, loo: f64| {
        [
            name.to_owned(),
            significant(unit.show(mae), 3),
            significant(unit.show(rmse), 3),
            significant(loo, 2),
        ]
    };
    for (name, mae, rmse, loo) in &surrogate.by_group {
        table.row(cells(name, *mae, *rmse, *loo));
    }
    table.emphasised(cells("all", surrogate.mae, surrogate.rmse, surrogate.loo));
    let caption = Caption::new(
        "Errors of the surrogate: mean absolute and root mean square over the validation runs, and \
         leave-one-out over the training runs relative to the variance of each output.",
        "sampling error over the design, far wider than the posterior.",
        "a group much worse than the others.",
    );
    numbers.table(&table, &caption)
}

fn pairs(findings: &Findings, surrogate: &SurrogateFindings, numbers: &mut Numbers) -> Markup {
    let unit = response_unit(findings);
    let shown: Vec<_> =
        surrogate.pairs.iter().map(|&(a, b)| (unit.show(a), unit.show(b))).collect();
    let label = response_label(findings);
    let (x, y) = (format!("simulated {label}"), format!("emulated {label}"));
    let drawing = agreement(&shown, (&x, &y), "emulated against simulated values");
    let keys =
        [Key::dot("s-pair", "one output of one validation run"), Key::line("s-equal", "equal")];
    let caption = Caption::new(
        "Emulated against simulated values of runs kept for validation.",
        "none is drawn: each dot is one output of one run.",
        "dots off the line, above all a bend at the ends.",
    );
    numbers.figure("surrogate", &[drawing], &keys, &caption)
}

fn sensitivity(findings: &Findings, sobol: &[(f64, f64)], numbers: &mut Numbers) -> Markup {
    let names: Vec<String> = findings.parameters.iter().map(|p| p.name.clone()).collect();
    let highest = sobol.iter().map(|s| s.1.max(s.0)).filter(|v| v.is_finite()).fold(1.0, f64::max);
    let chart = BarChart {
        names,
        series: vec![
            BarSeries {
                class: "s-first",
                name: String::from("first order"),
                values: sobol.iter().map(|s| s.0).collect(),
            },
            BarSeries {
                class: "s-total",
                name: String::from("total"),
                values: sobol.iter().map(|s| s.1).collect(),
            },
        ],
        levels: Vec::new(),
        x_label: String::from("parameter"),
        y: Axis::new("Sobol index [share of variance]", (0.0, 1.08 * highest)),
        outstanding: Vec::new(),
        numbers: true,
    };
    let keys = [
        Key::area("s-first", "first order: the parameter alone"),
        Key::area("s-total", "total: with all its interactions"),
    ];
    let caption = Caption::new(
        "Share of the response's variance that each parameter causes, over all outputs.",
        "variance over the design, not over the posterior.",
        "a small total index: the data can say little about that parameter. A total far above the \
         first order: it acts through the others.",
    );
    numbers.figure(
        "sobol-indices",
        &[chart.draw("Sobol indices of every parameter")],
        &keys,
        &caption,
    )
}

/// The leave-one-out error along the curves.
fn errors_along(
    findings: &Findings,
    surrogate: &SurrogateFindings,
    numbers: &mut Numbers,
) -> Markup {
    let errors = &surrogate.loo_by_output;
    let outlines = Curves::of(&findings.layouts);
    let Some((_, highest)) = extent(errors.iter().copied()) else { return html! {} };
    let value = |i: usize| errors.get(i).copied().unwrap_or(f64::NAN);
    let panel = |outline: &CurvePanel| Panel {
        title: outline.title.clone(),
        remark: String::new(),
        bands: Vec::new(),
        curves: vec![Curve {
            class: "s-map",
            name: "leave-one-out error".to_owned(),
            points: outline.curve(value),
        }],
    };
    let panels: Vec<Panel> = outlines.panels.iter().map(panel).collect();
    let x = Axis::new(outlines.label.as_str(), outlines.domain).ticks(6);
    let y = Axis::new("error [share]", (0.0, 1.06 * highest)).ticks(5);
    let keys = [Key::line("s-map", "leave-one-out error")];
    let caption = Caption::new(
        format!(
            "The surrogate's leave-one-out error at each place, relative to the variance of the output over the runs.{}",
            outlines.left_out_sentence()
        ),
        "sampling error over the design.",
        "places where the surrogate explains little: the data there say less than they could.",
    );
    let drawings = small_multiples(&panels, &x, &y, "error of the surrogate");
    numbers.figure("surrogate-error", &drawings, &keys, &caption)
}

/// The total Sobol indices along the curves, those of the parameters with the largest.
fn sensitivity_along(findings: &Findings, total: &Matrix, numbers: &mut Numbers) -> Markup {
    let outlines = Curves::of(&findings.layouts);
    let weight = |i: usize| -> f64 { total.column(i).into_iter().filter(|s| s.is_finite()).sum() };
    let mut order: Vec<usize> = (0..total.columns()).collect();
    order.sort_by(|&a, &b| weight(b).total_cmp(&weight(a)).then(a.cmp(&b)));
    order.truncate(LINES.len());
    let name =
        |input: usize| findings.parameters.get(input).map_or("", |p| p.name.as_str()).to_owned();
    let panel = |outline: &CurvePanel| {
        let line = |(&input, class): (&usize, &'static str)| Curve {
            class,
            name: name(input),
            points: outline.curve(|j| if j < total.rows() { total[(j, input)] } else { f64::NAN }),
        };
        Panel {
            title: outline.title.clone(),
            remark: String::new(),
            bands: Vec::new(),
            curves: order.iter().zip(LINES).map(line).collect(),
        }
    };
    let panels: Vec<Panel> = outlines.panels.iter().map(panel).collect();
    let x = Axis::new(outlines.label.as_str(), outlines.domain).ticks(6);
    let y = Axis::new("total Sobol index", (-0.05, 1.1)).ticks(4);
    let keys: Vec<Key> =
        order.iter().zip(LINES).map(|(&input, class)| Key::line(class, name(input))).collect();
    let further = match total.columns() - order.len() {
        0 => String::new(),
        n => format!(" {n} parameters with smaller indices are not drawn."),
    };
    let caption = Caption::new(
        format!(
            "Total Sobol indices at each place: the share of the response's variance there in which a parameter takes part.{further}{}",
            outlines.left_out_sentence()
        ),
        "variance over the design, not over the posterior.",
        "the sensors and times from which a parameter is learned.",
    );
    let drawings = small_multiples(&panels, &x, &y, "Sobol indices");
    numbers.figure("sobol-along-curves", &drawings, &keys, &caption)
}
