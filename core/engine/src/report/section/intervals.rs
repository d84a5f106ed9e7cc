//! Bounds of quantities over the intervals of parameters, and their probability boxes.

use lacuna::math::moments;
use maud::{Markup, html};

use super::first_of_quantities;
use super::quantities::unit;
use crate::page::chart::{Axis, Band, Curve, Key, Panel, small_multiples};
use crate::page::drawing::Drawing;
use crate::page::number::{count, significant};
use crate::page::scale::{ShownUnit, extent, padded};
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section};
use crate::report::findings::{
    Bounds, BoundsFindings, End, Findings, PROBABILITIES, QuantityFindings,
};

/// The bounds; `None` in a study without intervals.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let found = findings.propagated.as_ref()?.bounds.as_ref()?;
    let table = bounds_table(findings)?;
    let content = html! {
        (bounds(&table, found, numbers))
        (boxes(&findings.quantities, numbers))
    };
    Some(Section { id: "intervals", title: "Bounds over intervals", content })
}

/// The search in one sentence.
pub fn sentence(found: &BoundsFindings) -> String {
    let names: Vec<String> = found.intervals.iter().map(|own| format!("`{}`", own.name)).collect();
    format!(
        "The quantities were bounded over the intervals of {}, of which no distribution is known.",
        names.join(", ")
    )
}

/// Table of the bounds of each figure, with the values at which they are reached; `None` without intervals.
pub fn bounds_table(findings: &Findings) -> Option<Table> {
    let found = findings.propagated.as_ref()?.bounds.as_ref()?;
    let heads = ["lower", "s.e.", "upper", "s.e.", "apart"];
    let mut table = Table::new(&["quantity", "unit", "figure", "lower at", "upper at"], &heads);
    for quantity in &findings.quantities {
        let Some(bounds) = &quantity.bounds else { continue };
        let unit = unit(quantity);
        for (k, (figure, range)) in bounds.named().into_iter().enumerate() {
            let (name, shown) = if k == 0 {
                (quantity.name.clone(), unit.unit.clone())
            } else {
                Default::default()
            };
            let mut cells = vec![name, shown, figure.to_owned()];
            cells.extend([&range.lower, &range.upper].map(|end| at(end, found)));
            for end in [&range.lower, &range.upper] {
                cells.push(significant(unit.show(end.value), 5));
                cells.push(significant(unit.show(end.error), 2));
            }
            let apart = range.lower.difference.max(range.upper.difference);
            cells.push(significant(unit.show(apart), 2));
            table.row(cells);
        }
    }
    (!table.is_empty()).then_some(table)
}

/// Largest number of interval parameters whose values are shown in a cell.
const MOST_NAMED: usize = 4;

/// Values at which an end is reached, such as `c = 0.3`.
fn at(end: &End, found: &BoundsFindings) -> String {
    let each = found.intervals.iter().zip(&end.at).take(MOST_NAMED);
    let mut all: Vec<String> =
        each.map(|(own, value)| format!("{} = {}", own.name, significant(*value, 4))).collect();
    if found.intervals.len() > MOST_NAMED {
        all.push(String::from("…"));
    }
    all.join(", ")
}

fn bounds(table: &Table, found: &BoundsFindings, numbers: &mut Numbers) -> Markup {
    let (points, draws) = (count(found.points), count(found.draws));
    let of_search = if found.searched_draws < found.draws {
        format!(" of {} draws each; the bounds are those of {draws} draws", found.searched_draws)
    } else if found.draws > 1 {
        format!(" of {draws} draws each")
    } else {
        String::new()
    };
    let ended =
        if found.exhausted { ", where the search ended for want of further points" } else { "" };
    let caption = Caption::new(
        format!(
            "Smallest and largest value of each figure over the intervals, with Monte Carlo standard errors (s.e.) and the \
             values of the interval parameters there, from {points} points{of_search}{ended}. The last column is how far two \
             independent searches ended apart."
        ),
        "the priors, at one fixed and unknown value of each interval parameter; no value in an interval is more likely than \
         another.",
        "a last column that is not small beside the width of the bounds: true bounds may lie farther apart.",
    );
    numbers.table(table, &caption)
}

/// Largest number of quantities whose boxes are drawn.
const MOST: usize = 8;

/// Probability boxes of the quantities.
fn boxes(all: &[QuantityFindings], numbers: &mut Numbers) -> Markup {
    let bounded: Vec<(&QuantityFindings, &Bounds)> =
        all.iter().filter_map(|found| Some((found, found.bounds.as_ref()?))).collect();
    let drawings: Vec<Drawing> =
        bounded.iter().take(MOST).flat_map(|(found, bounds)| drawing(found, bounds)).collect();
    if drawings.is_empty() {
        return html! {};
    }
    let keys = [
        Key::area("s-band", "probability box"),
        Key::line("s-mean", "bounds"),
        Key::line("s-reference", "intervals at their middle"),
    ];
    let caption = Caption::new(
        format!(
            "Bounds of the cumulative distribution of each quantity, from its quantiles at {} probabilities; the steps lie \
             outside the bounds between them.{}",
            PROBABILITIES.len(),
            first_of_quantities(bounded.len(), MOST)
        ),
        "the priors, at every value that the intervals allow: each gives a curve inside the box.",
        "a box that is much wider than the dashed curve is steep: what is unknown in the intervals outweighs what varies.",
    );
    numbers.figure("probability-boxes", &drawings, &keys, &caption)
}

fn drawing(found: &QuantityFindings, bounds: &Bounds) -> Vec<Drawing> {
    let own = unit(found);
    let range =
        padded(extent(bounds.quantiles.iter().flatten().copied()).unwrap_or((0.0, 1.0)), 0.06);
    let mut places: Vec<f64> =
        bounds.quantiles.iter().flatten().copied().chain([range.0, range.1]).collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    let mut edges = Vec::new();
    for pair in places.windows(2) {
        let [low, high] = bounds.probability(pair[0]);
        edges.extend([(own.show(pair[0]), low, high), (own.show(pair[1]), low, high)]);
    }
    let curve = |class, name: &str, points| Curve { class, name: name.to_owned(), points };
    let panel = Panel {
        title: found.name.clone(),
        remark: String::new(),
        curves: vec![
            curve("s-mean", "lower bound", edges.iter().map(|&(x, low, _)| (x, low)).collect()),
            curve("s-mean", "upper bound", edges.iter().map(|&(x, _, high)| (x, high)).collect()),
            curve("s-reference", "intervals at their middle", middle(found, &own)),
        ],
        bands: vec![Band { class: "s-band", edges }],
    };
    let x = Axis::new(own.label(&found.name), (own.show(range.0), own.show(range.1))).ticks(6);
    let y = Axis::new("cumulative probability", (0.0, 1.0)).ticks(5);
    small_multiples(&[panel], &x, &y, &format!("probability box of {}", found.name))
}

/// Cumulative distribution of the draws with the intervals at their middle.
fn middle(found: &QuantityFindings, own: &ShownUnit) -> Vec<(f64, f64)> {
    let sorted = moments::sorted(&found.values);
    let at = |p: f64| (own.show(moments::quantile(&sorted, p)), p);
    let ends = [(0.0, PROBABILITIES[0]), (1.0, PROBABILITIES[PROBABILITIES.len() - 1])];
    let [first, last] = ends.map(|(p, place)| (at(place).0, p));
    [first].into_iter().chain(PROBABILITIES.map(at)).chain([last]).collect()
}
