//! The correlation matrix as coloured squares labelled with their values.

use lacuna_linalg::Matrix;

use super::{PANEL, shortened};
use crate::page::drawing::{Datum, Drawing};
use crate::page::number::{fixed, typeset};
use crate::page::svg::{Anchor, Area, Svg};

/// Width reserved for the names beside the squares.
const NAMES: f64 = 210.0;
/// Smaller squares have no room for their number, which is then shown as a hint only.
const SMALLEST_WITH_NUMBER: f64 = 34.0;
/// Smaller squares have no hint.
const SMALLEST_WITH_HINT: f64 = 8.0;
/// Smaller squares have no room for a name below them: columns are numbered instead.
const SMALLEST_WITH_NAME: f64 = 60.0;

/// Draws a correlation matrix (`names x names`); blue is positive, red negative.
pub fn correlation_map(names: &[String], correlation: &Matrix, description: &str) -> Drawing {
    let n = names.len().min(correlation.rows()).min(correlation.columns());
    let pairs = || (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    let size = |&(i, j): &(usize, usize)| correlation[(i, j)].abs();
    let strongest =
        pairs().filter(|p| size(p).is_finite()).max_by(|a, b| size(a).total_cmp(&size(b)));
    let said = strongest.map_or_else(String::new, |(i, j)| {
        let value = typeset(&fixed(correlation[(i, j)], 2));
        format!(": the strongest is {value}, of {} and {}", names[j], names[i])
    });
    let words = format!("{description}{said}");
    let cells = pairs().map(|(i, j)| Datum::named("", &names[i], &names[j], correlation[(i, j)]));
    let values = cells.collect();
    Drawing::wide(
        |width| sized(&names[..n], correlation, width, &words),
        ["", "correlation"],
        values,
    )
}

fn sized(names: &[String], correlation: &Matrix, width: f64, description: &str) -> String {
    let n = names.len();
    let beside = if width > PANEL { NAMES } else { 110.0 };
    let side = ((width - beside) / n.max(1) as f64).min(96.0);
    let left = beside.max((width - side * n as f64) / 2.0);
    let mut svg = Svg::new(width, side * n as f64 + 34.0);
    for (i, name) in names.iter().take(n).enumerate() {
        let top = i as f64 * side + 4.0;
        let is_named = side >= SMALLEST_WITH_NAME;
        let letters = ((left - 14.0) / 7.0) as usize;
        let beside = if is_named {
            shortened(name, letters)
        } else {
            format!("{} · {}", shortened(name, letters.saturating_sub(5)), i + 1)
        };
        svg.text("cell-name", (left - 10.0, top + 0.5 * side + 4.0), Anchor::End, &beside);
        let below = (left + (i as f64 + 0.5) * side, side * n as f64 + 22.0);
        let label = if is_named {
            shortened(name, ((side / 6.4) as usize).max(3))
        } else {
            (i + 1).to_string()
        };
        svg.text("cell-name", below, Anchor::Middle, &label);
        for j in 0..n {
            let cell = Area::new(left + j as f64 * side, top, side - 2.0, side - 2.0);
            draw_cell(&mut svg, cell, (name, &names[j]), correlation[(i, j)]);
        }
    }
    svg.finish(description)
}

fn draw_cell(svg: &mut Svg, cell: Area, names: (&str, &str), value: f64) {
    let text = typeset(&fixed(value, 2));
    // Smaller cells cannot be pointed at.
    let hint = if cell.width < SMALLEST_WITH_HINT {
        String::new()
    } else {
        format!("{}, {}: {text}", names.0, names.1)
    };
    svg.rectangle(&format!("cell {}", shade(value)), cell, &hint);
    if cell.width >= SMALLEST_WITH_NUMBER {
        let middle = (cell.x + 0.5 * cell.width, cell.y + 0.5 * cell.height + 4.5);
        // The two darkest shades on either side carry light letters.
        let class = if value.abs() >= 0.7 { "cell-light" } else { "cell-dark" };
        svg.text(class, middle, Anchor::Middle, &text);
    }
}

/// CSS class of the colour: five steps on either side of zero.
fn shade(value: f64) -> String {
    if !value.is_finite() {
        return String::from("c-none");
    }
    let step = (value.abs().min(1.0) * 5.0).round() as i64;
    match (step, value < 0.0) {
        (0, _) => String::from("c-0"),
        (step, true) => format!("c-minus-{step}"),
        (step, false) => format!("c-plus-{step}"),
    }
}
