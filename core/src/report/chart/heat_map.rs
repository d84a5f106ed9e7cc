//! The correlation matrix as coloured squares with the numbers in them.

use super::WIDTH;
use crate::linalg::Matrix;
use crate::report::number::{fixed, typeset};
use crate::report::svg::{Anchor, Area, Svg};

/// A correlation matrix; blue is positive, red negative, and every square carries its number.
pub fn correlation_map(names: &[String], correlation: &Matrix, description: &str) -> String {
    let n = names.len().min(correlation.rows()).min(correlation.columns());
    let side = (560.0 / n.max(1) as f64).clamp(26.0, 96.0);
    let width = side * n as f64;
    let left = 200.0_f64.max((WIDTH - width) / 2.0).min(WIDTH - width);
    let mut svg = Svg::new(WIDTH, side * n as f64 + 34.0);
    for (i, name) in names.iter().take(n).enumerate() {
        let top = i as f64 * side + 4.0;
        svg.text("cell-name", (left - 10.0, top + 0.5 * side + 4.0), Anchor::End, name);
        let below = (left + (i as f64 + 0.5) * side, side * n as f64 + 22.0);
        svg.text("cell-name", below, Anchor::Middle, &shortened(name, side));
        for j in 0..n {
            let value = correlation[(i, j)];
            let cell = Area::new(left + j as f64 * side, top, side - 2.0, side - 2.0);
            let text = typeset(&fixed(value, 2));
            let hint = format!("{name}, {}: {text}", names[j]);
            svg.rectangle(&format!("cell {}", shade(value)), cell, &hint);
            let middle = (cell.x + 0.5 * cell.width, cell.y + 0.5 * cell.height + 4.5);
            let class = if value.abs() > 0.6 { "cell-light" } else { "cell-dark" };
            svg.text(class, middle, Anchor::Middle, &text);
        }
    }
    svg.finish(description)
}

/// The class of a colour: five steps on either side of zero.
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

/// A name cut to the width of a square.
fn shortened(name: &str, width: f64) -> String {
    let letters = ((width / 6.4) as usize).max(3);
    if name.chars().count() <= letters {
        return name.to_owned();
    }
    name.chars().take(letters - 1).chain(['…']).collect()
}
