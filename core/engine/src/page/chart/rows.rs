//! Horizontal bars with names and numbers, such as times or shares of a variance.

use super::WIDTH;
use crate::page::svg::{Anchor, Area, Svg};

/// One bar.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name of the bar.
    pub name: String,
    /// Length of the bar.
    pub value: f64,
    /// Text beside the bar, usually its value.
    pub text: String,
}

/// Draws bars below each other, with lengths proportional to their values.
pub fn row_chart(rows: &[Row], class: &str, description: &str) -> String {
    const HEIGHT: f64 = 26.0;
    let left = 190.0;
    let longest = rows.iter().map(|r| r.value).filter(|v| v.is_finite()).fold(0.0, f64::max);
    let mut svg = Svg::new(WIDTH, rows.len() as f64 * HEIGHT + 10.0);
    for (i, row) in rows.iter().enumerate() {
        let top = i as f64 * HEIGHT + 5.0;
        let share = if longest > 0.0 && row.value.is_finite() { row.value / longest } else { 0.0 };
        let length = (share.max(0.0) * (WIDTH - left - 210.0)).max(1.0);
        svg.text("cell-name", (left - 10.0, top + 15.0), Anchor::End, &row.name);
        svg.rectangle(class, Area::new(left, top, length, HEIGHT - 6.0), "");
        svg.text("row-number", (left + length + 8.0, top + 15.0), Anchor::Start, &row.text);
    }
    svg.line("axis-line", (left, 2.0), (left, rows.len() as f64 * HEIGHT + 6.0));
    svg.finish(description)
}
