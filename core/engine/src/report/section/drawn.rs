//! Responses at draws of the posterior, and the draws as the page's script takes them.

use maud::{Markup, PreEscaped, html};

use super::{coordinate_unit, response_label, response_unit};
use crate::page::chart::{Axis, Curve, Key, Panel, small_multiples};
use crate::page::curves::Curves;
use crate::page::scale::{extent, padded};
use crate::page::{Caption, Numbers};
use crate::report::findings::{DrawnResponses, Findings};
use crate::stage::validate::ValidationFindings;

/// Largest number of points of all drawn curves together.
const MOST_POINTS: usize = 36_000;

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
    let panel = |outline: &crate::page::curves::CurvePanel| {
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
        (data(findings, drawn, count))
    }
}

/// Number of draws for which there is room.
fn shown(drawn: &DrawnResponses, outlines: &Curves) -> usize {
    let points: usize = outlines.panels.iter().map(|panel| panel.curve(|_| 0.0).len()).sum();
    (MOST_POINTS / points.max(1)).max(FEWEST).min(drawn.responses.len())
}

/// The draws in displayed units, five digits of each, for the choice of a region of the pairs.
fn data(findings: &Findings, drawn: &DrawnResponses, count: usize) -> Markup {
    let Some(calibration) = &findings.calibration else { return html! {} };
    let values: Vec<Vec<f64>> = drawn.points[..count]
        .iter()
        .map(|point| {
            let each = point.iter().zip(&calibration.coordinates);
            let shown = each.map(|(value, c)| coordinate_unit(c).show(*value));
            shown.map(|v| format!("{v:.4e}").parse().unwrap_or(f64::NAN)).collect()
        })
        .collect();
    // Numbers that are not finite become `null`. No text of the study is in it.
    let text = serde_json::json!({ "values": values }).to_string();
    html! { script type="application/json" id="draws" { (PreEscaped(text)) } }
}
