//! Responses at draws of the posterior, and the draws as the page's script takes them.

use std::collections::BTreeMap;

use maud::{Markup, PreEscaped, html};

use super::{coordinate_unit, response_label, response_unit};
use crate::page::chart::{Axis, Curve, Key, Panel, small_multiples};
use crate::page::curves::{CurvePanel, Curves};
use crate::page::scale::{ShownUnit, extent, padded};
use crate::page::{Caption, Numbers};
use crate::report::findings::{DrawnResponses, Findings};
use crate::stage::screen::Z975;
use crate::stage::validate::ValidationFindings;

/// Largest number of points of all drawn curves together.
const MOST_POINTS: usize = 30_000;

/// Smallest number of draws that is drawn, if there are as many.
const FEWEST: usize = 10;

/// The curves of the draws with the measurements; empty without draws.
pub fn figure(
    findings: &Findings,
    validation: &ValidationFindings,
    numbers: &mut Numbers,
) -> Markup {
    let Some(drawn) = &findings.drawn else { return html! {} };
    let outlines = Curves::of(&findings.layouts);
    let unit = response_unit(findings);
    let count = shown(drawn, &outlines);
    let panel = |outline: &CurvePanel| {
        let draw = |(k, response): (usize, &Vec<f64>)| Curve {
            class: "s-draw",
            name: format!("draw {}", k + 1),
            points: outline.curve(|i| unit.show(response[i])),
        };
        let mean = |i: usize| {
            let known = validation.replicates.get(i).filter(|r| r.0 > 0);
            known.map_or(f64::NAN, |r| unit.show(r.1))
        };
        let measured =
            Curve { class: "s-mean", name: "measured".to_owned(), points: outline.curve(mean) };
        let draws = drawn.responses.iter().take(count).enumerate().map(draw);
        Panel {
            title: outline.title.clone(),
            remark: String::new(),
            bands: Vec::new(),
            curves: draws.chain([measured]).collect(),
        }
    };
    let panels: Vec<Panel> = outlines.panels.iter().map(panel).collect();
    let values = panels.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points).map(|p| p.1);
    let x = Axis::new(outlines.label.as_str(), outlines.domain).ticks(6);
    let range = padded(extent(values).unwrap_or((0.0, 1.0)), 0.06);
    let y = Axis::new(response_label(findings), range).ticks(4);
    let keys = [
        Key::line("s-mean", "mean of the replicates, or the only one"),
        Key::line("s-draw", "response at a draw of the posterior"),
    ];
    let caption = Caption::new(
        format!(
            "Emulated responses, with the study's effects, at {count} draws of the posterior. Draws that are chosen in the pairs \
             above are marked here.{}",
            outlines.left_out_sentence()
        ),
        "the posterior of the parameters alone: noise, discrepancy and the emulator's error are not in these curves.",
        "measured curves outside the bundle: parameters alone do not explain them.",
    );
    let drawings = small_multiples(&panels, &x, &y, "responses at draws of the posterior");
    html! {
        (numbers.figure("posterior-draws", &drawings, &keys, &caption))
        (data(findings, validation, &outlines, (drawn, count)))
    }
}

/// Number of draws for which there is room.
fn shown(drawn: &DrawnResponses, outlines: &Curves) -> usize {
    let points: usize = outlines.panels.iter().map(|panel| panel.curve(|_| 0.0).len()).sum();
    (MOST_POINTS / points.max(1)).max(FEWEST).min(drawn.responses.len())
}

/// The draws in displayed units, five digits of each, for the choice of a region of the pairs, and by panel what their
/// residuals need.
fn data(
    findings: &Findings,
    validation: &ValidationFindings,
    outlines: &Curves,
    (drawn, count): (&DrawnResponses, usize),
) -> Markup {
    let Some(calibration) = &findings.calibration else { return html! {} };
    let values: Vec<Vec<f64>> = drawn.points[..count]
        .iter()
        .map(|point| {
            let each = point.iter().zip(&calibration.coordinates);
            each.map(|(value, c)| five_digits(coordinate_unit(c).show(*value))).collect()
        })
        .collect();
    let unit = response_unit(findings);
    let panels = outlines.panels.iter();
    let residuals: BTreeMap<&str, Vec<[f64; 3]>> = panels
        .map(|outline| (outline.title.as_str(), compared(outline, validation, &unit)))
        .collect();
    // Numbers that are not finite become `null`.
    let text = serde_json::json!({ "values": values, "residuals": residuals }).to_string();
    // No text may end the script.
    let text = text.replace('<', "\\u003c");
    html! { script type="application/json" id="draws" { (PreEscaped(text)) } }
}

fn five_digits(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(f64::NAN)
}

/// Largest number of places of a panel at which residuals of draws are shown.
const MOST_PLACES: usize = 240;

/// Place, measured mean and standard deviation of a new replicate, in displayed units, where all are known.
fn compared(
    outline: &CurvePanel,
    validation: &ValidationFindings,
    unit: &ShownUnit,
) -> Vec<[f64; 3]> {
    let Some((low, high)) = &validation.predictive else { return Vec::new() };
    let known = |&(at, i): &(f64, usize)| {
        let &(replicates, mean, _) = validation.replicates.get(i)?;
        let sd = (high.get(i)? - low.get(i)?) / (2.0 * Z975);
        // The mean is not rounded: it may be far larger than the deviation.
        let found = [five_digits(at), unit.show(mean), five_digits(unit.show(sd))];
        (replicates > 0 && sd > 0.0 && found.iter().all(|v| v.is_finite())).then_some(found)
    };
    let stride = outline.places.len().div_ceil(MOST_PLACES).max(1);
    outline.places.iter().step_by(stride).filter_map(known).collect()
}
