//! The work of the search as one picture: the gap before, what each effect took, and the remainder.

use maud::{Markup, html};

use super::View;
use super::sentences::on;
use crate::gap::result::GapResult;
use crate::page::chart::Axis;
use crate::page::chart::{Curve, Key, Panel, Row, row_chart, small_multiples};
use crate::page::curves::{CurvePanel, Curves};
use crate::page::number::percent;
use crate::page::scale::{extent, padded};
use crate::page::{Caption, Numbers};

/// The shares of the gap, and the gap along the curves; empty if no effect was found.
pub fn figure(view: &View<'_>, result: &GapResult, numbers: &mut Numbers) -> Markup {
    if result.additions.is_empty() {
        return html! {};
    }
    html! { (shares(result, numbers)) (along(view, result, numbers)) }
}

fn shares(result: &GapResult, numbers: &mut Numbers) -> Markup {
    let row = |name: String, value: f64| Row {
        name,
        value,
        text: format!("{} of the gap", percent(value)),
    };
    let left = 1.0 - result.verdict.closed.clamp(0.0, 1.0);
    let taken = result.additions.iter().map(|addition| {
        row(format!("{}{}", addition.label(), on(&addition.on)), addition.share.clamp(0.0, 1.0))
    });
    let rows: Vec<Row> = std::iter::once(row("the gap before".to_owned(), 1.0))
        .chain(taken)
        .chain([row("remainder".to_owned(), left)])
        .collect();
    let caption = Caption::new(
        "The gap before, what each effect took of it beside the others, and what remains. Effects that act alike share what they \
         take, so that the shares need not add up.",
        "excess misfit of the data of the search over that of noise.",
        "a remainder that is not small: something else is missing.",
    );
    let drawing = row_chart(&rows, "bar s-part", "the gap before, its parts, and the remainder");
    numbers.figure("gap-shares", &[drawing], &[], &caption)
}

fn along(view: &View<'_>, result: &GapResult, numbers: &mut Numbers) -> Markup {
    let (unit, outlines) = (&view.response, Curves::of(view.layouts));
    let is_known = |i: usize| result.counts[i] > 0.0;
    let known = |i: usize, value: f64| if is_known(i) { unit.show(value) } else { f64::NAN };
    let panel = |outline: &CurvePanel| {
        let line = |class, name: &str, value: &dyn Fn(usize) -> f64| Curve {
            class,
            name: name.to_owned(),
            points: outline.curve(value),
        };
        let before = |i: usize| known(i, result.means[i] - result.response[0][i]);
        let taken = |i: usize| known(i, result.response[1][i] - result.response[0][i]);
        let after = |i: usize| known(i, result.means[i] - result.response[1][i]);
        Panel {
            title: outline.title.clone(),
            remark: String::new(),
            bands: Vec::new(),
            curves: vec![
                line("s-reference", "before", &before),
                line("s-third", "taken by the effects", &taken),
                line("s-map", "remainder", &after),
            ],
        }
    };
    let panels: Vec<Panel> = outlines.panels.iter().map(panel).collect();
    let values = panels.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points).map(|p| p.1);
    let range = padded(extent(values).unwrap_or((-1.0, 1.0)), 0.06);
    let x = Axis::new(outlines.label.as_str(), outlines.domain).ticks(6);
    let y = Axis::new(view.label(), range).ticks(4);
    let keys = [
        Key::line("s-reference", "before: measured less calibrated model"),
        Key::line("s-third", "taken: response with the effects less response without"),
        Key::line("s-map", "remainder: measured less model with the effects"),
    ];
    let caption = Caption::new(
        format!(
            "The same along the curves: before is taken plus remainder. The parameters are calibrated anew with the effects, so what \
             is taken holds their shift too.{}",
            outlines.left_out_sentence()
        ),
        "means of the replicates that were not held out.",
        "a remainder without shape, and a green line that follows the blue one.",
    );
    let drawings = small_multiples(&panels, &x, &y, "gap before, taken and remainder");
    numbers.figure("gap-picture", &drawings, &keys, &caption)
}
