//! The figures of the gap.

use maud::Markup;

use super::View;
use crate::gap::report::sentences::on;
use crate::gap::result::{GapResult, StepResult};
use crate::page::chart::{
    Axis, Band, Curve, Key, Panel, Row, Strip, residual_map, row_chart, small_multiples,
};
use crate::page::curves::{Curves, axis_unit};
use crate::page::drawing::Drawing;
use crate::page::number::{fixed, typeset};
use crate::page::scale::{extent, padded};
use crate::page::{Caption, Numbers};

/// Largest number of curves of a map.
const MOST_CURVES: usize = 60;

/// Largest number of types that are shown by their evidence.
const MOST_LEADERS: usize = 14;

/// The residual maps without and with the effects that were found.
pub fn maps(view: &View<'_>, result: &GapResult, numbers: &mut Numbers) -> Markup {
    let unit = axis_unit(view.layouts);
    let places = || result.curves.iter().flat_map(|c| &c.at).map(|&t| unit.show(t));
    let domain = extent(places()).unwrap_or((0.0, 1.0));
    let name = view.layouts.blocks[0].abscissa().map_or("", |(name, ..)| name);
    let x = Axis::new(unit.label(name), domain).ticks(6);
    let map = |k: usize| {
        let strips: Vec<Strip> = result
            .curves
            .iter()
            .enumerate()
            .filter(|(_, curve)| !curve.measured.is_empty())
            .take(MOST_CURVES)
            .map(|(s, curve)| {
                let each = curve.measured.iter().zip(&curve.at);
                let spots = result.regions[k].iter().filter(|spot| spot.curves.contains(&s));
                let scenario = curve.scenario.as_ref().map(|s| format!(" · {s}"));
                Strip {
                    name: format!("{}{}", curve.name, scenario.unwrap_or_default()),
                    points: each.map(|(&i, t)| (unit.show(*t), result.left[k][i])).collect(),
                    outlines: spots
                        .map(|spot| (unit.show(spot.span.0), unit.show(spot.span.1)))
                        .collect(),
                }
            })
            .collect();
        let title = ["without the effects", "with them"][k];
        residual_map(&strips, &x, &format!("residual map {title}"))
    };
    let both = !result.additions.is_empty();
    let drawings: Vec<Drawing> = if both { vec![map(0), map(1)] } else { vec![map(0)] };
    let shown = result.curves.len().min(MOST_CURVES);
    let further = match result.curves.len() - shown {
        0 => String::new(),
        n => format!(" {n} further curves found no room."),
    };
    let which =
        if both { "above without, below with what was found" } else { "no effect was found" };
    let caption = Caption::new(
        format!(
            "What calibration cannot absorb of the difference between the replicates' mean and the calibrated \
             response, in standard deviations of what noise and emulator make of it ({which}). Blue: measured above \
             the model; red: below; the darkest colour is six or more. Outlined: places that are wrong beyond \
             doubt, all of them together with the level of the tests.{further}"
        ),
        "white noise of standard deviation one where nothing is missing.",
        "colour that stays with what was found; one sensor alone points at its chain, all sensors together at the \
         model.",
    );
    numbers.figure("gap-residuals", &drawings, &[], &caption)
}

/// A line of a figure of curves: CSS class, name, label in the legend, and value at an output.
struct Line<'a> {
    class: &'static str,
    name: &'static str,
    key: &'static str,
    value: &'a dyn Fn(usize) -> f64,
}

/// A band of a figure of curves: label in the legend, and edges at an output if there are any.
struct Edges<'a> {
    key: &'static str,
    at: &'a dyn Fn(usize) -> Option<(f64, f64)>,
}

/// The measured curves against the calibrated responses without and with the effects that were found.
pub fn curves(view: &View<'_>, result: &GapResult, numbers: &mut Numbers) -> Markup {
    let unit = &view.response;
    let is_known = |i: usize| result.counts[i] > 0.0;
    let measured = |i: usize| if is_known(i) { unit.show(result.means[i]) } else { f64::NAN };
    let response = |k: usize, i: usize| unit.show(result.response[k][i]);
    let edges = |i: usize| {
        let half = 1.96 * unit.show(result.sd[i]);
        is_known(i).then(|| (measured(i) - half, measured(i) + half))
    };
    let (without, with) = (|i: usize| response(0, i), |i: usize| response(1, i));
    let mut lines = vec![
        Line { class: "s-mean", name: "measured", key: "mean of the replicates", value: &measured },
        Line {
            class: "s-reference",
            name: "without",
            key: "calibrated without the effects",
            value: &without,
        },
    ];
    if !result.additions.is_empty() {
        let key = "calibrated with them";
        lines.push(Line { class: "s-map", name: "with", key, value: &with });
    }
    let outlines = Curves::of(view.layouts);
    let caption = Caption::new(
        format!(
            "Measured against simulated, both calibrated to the replicates that were not held out.{}",
            outlines.left_out_sentence()
        ),
        "the grey band is of the replicates, by the noise that was found in them.",
        "where the orange line leaves the blue one for the black one.",
    );
    let band = Edges { key: "a replicate's 95 % interval", at: &edges };
    let title = ("gap-curves", "measured and simulated curves");
    figure(&outlines, &view.label(), &lines, &band, title, &caption, numbers)
}

/// The difference between the measured curves and the calibrated responses without and with the effects that were
/// found.
pub fn differences(view: &View<'_>, result: &GapResult, numbers: &mut Numbers) -> Markup {
    let unit = &view.response;
    let is_known = |i: usize| result.counts[i] > 0.0;
    let difference = |k: usize, i: usize| {
        if is_known(i) { unit.show(result.means[i] - result.response[k][i]) } else { f64::NAN }
    };
    let edges = |i: usize| {
        let half = 1.96 * unit.show(result.sd[i]) / result.counts[i].sqrt();
        is_known(i).then_some((-half, half))
    };
    let (without, with) = (|i: usize| difference(0, i), |i: usize| difference(1, i));
    let mut lines = vec![Line {
        class: "s-reference",
        name: "measured less model without",
        key: "measured less model without the effects",
        value: &without,
    }];
    if !result.additions.is_empty() {
        let (name, key) = ("measured less model with", "measured less model with them");
        lines.push(Line { class: "s-map", name, key, value: &with });
    }
    let caption = Caption::new(
        "The same as differences: the mean of the replicates less the calibrated response.",
        "the grey band is of the mean of the replicates, point by point; neighbouring points are not independent.",
        "differences with a shape, and whether they lose it.",
    );
    let key = "95 % interval of the replicates' mean, without emulator's error";
    let (band, outlines) = (Edges { key, at: &edges }, Curves::of(view.layouts));
    let title = ("gap-differences", "measured less simulated curves");
    figure(&outlines, &view.label(), &lines, &band, title, &caption, numbers)
}

/// Lines over a band, curve by curve.
fn figure(
    outlines: &Curves,
    label: &str,
    lines: &[Line<'_>],
    band: &Edges<'_>,
    (name, title): (&str, &str),
    caption: &Caption,
    numbers: &mut Numbers,
) -> Markup {
    let panels: Vec<Panel> = outlines
        .panels
        .iter()
        .map(|outline| {
            let curve = |line: &Line<'_>| Curve {
                class: line.class,
                name: line.name.to_owned(),
                points: outline.curve(line.value),
            };
            Panel {
                title: outline.title.clone(),
                remark: String::new(),
                bands: vec![Band { class: "s-band", edges: outline.band(band.at) }],
                curves: lines.iter().map(curve).collect(),
            }
        })
        .collect();
    let points = panels.iter().flat_map(|p| p.curves.iter().flat_map(|c| c.points.iter()));
    let range = padded(extent(points.map(|p| p.1)).unwrap_or((-1.0, 1.0)), 0.06);
    let x = Axis::new(outlines.label.as_str(), outlines.domain).ticks(6);
    let y = Axis::new(label, range).ticks(4);
    let mut keys: Vec<Key> = lines.iter().map(|line| Key::line(line.class, line.key)).collect();
    keys.insert(1, Key::area("s-band", band.key));
    let drawings = small_multiples(&panels, &x, &y, title);
    numbers.figure(name, &drawings, &keys, caption)
}

/// The placement with the largest evidence of each type.
pub fn leaders(step: &StepResult, numbers: &mut Numbers) -> Markup {
    let mut seen: Vec<&str> = Vec::new();
    let mut rows: Vec<Row> = Vec::new();
    let lowest = step.leaders.iter().map(|l| l.log_weight).filter(|w| w.is_finite());
    let lowest = lowest.fold(0.0, f64::min) - 1.0;
    for leader in &step.leaders {
        if seen.contains(&leader.kind.as_str()) || rows.len() == MOST_LEADERS {
            continue;
        }
        seen.push(&leader.kind);
        rows.push(Row {
            name: leader.kind.clone(),
            value: leader.log_weight - lowest,
            text: format!(
                "{}{} · score {}",
                typeset(&fixed(leader.log_weight, 1)),
                on(&leader.on),
                fixed(leader.score, 1)
            ),
        });
    }
    let caption = Caption::new(
        "Candidates by evidence: the logarithm of the probability of the data with the best version of each type, \
         relative to the best of all, every type with the same prior mass divided among its places; parameters and \
         effect calibrated together.",
        "",
        "types within three of the best: these data cannot tell them apart.",
    );
    let drawing = row_chart(&rows, "bar s-part", "candidates by evidence");
    numbers.figure("gap-candidates", &[drawing], &[], &caption)
}
