//! Horizontal bars with names and numbers, such as times or shares of a variance.

use super::{PANEL, shortened};
use crate::page::drawing::{Datum, Drawing};
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

/// Draws bars below each other, with lengths proportional to their values; on a narrow drawing, names stand above bars.
pub fn row_chart(rows: &[Row], class: &str, description: &str) -> Drawing {
    let said: Vec<String> = rows.iter().map(|row| format!("{}: {}", row.name, row.text)).collect();
    let words = format!("{description}: {}", said.join("; "));
    let values = rows.iter().map(|row| Datum::named("", "", &row.name, row.value)).collect();
    Drawing::wide(|width| sized(rows, class, width, &words), ["", ""], values)
}

fn sized(rows: &[Row], class: &str, width: f64, description: &str) -> String {
    let narrow = width <= PANEL;
    let (height, above) = if narrow { (52.0, 18.0) } else { (26.0, 0.0) };
    let left = if narrow { 2.0 } else { 190.0 };
    let room = width - left - if narrow { 10.0 } else { 210.0 };
    let longest = rows.iter().map(|r| r.value).filter(|v| v.is_finite()).fold(0.0, f64::max);
    let mut svg = Svg::new(width, rows.len() as f64 * height + 10.0);
    for (i, row) in rows.iter().enumerate() {
        let top = i as f64 * height + 5.0;
        let share = if longest > 0.0 && row.value.is_finite() { row.value / longest } else { 0.0 };
        let length = (share.max(0.0) * room).max(1.0);
        let bar = Area::new(left, top + above, length, 20.0);
        svg.rectangle(class, bar, &format!("{}: {}", row.name, row.text));
        if narrow {
            let name = shortened(&format!("{} · {}", row.name, row.text), 52);
            svg.text("row-number", (left, top + 12.0), Anchor::Start, &name);
        } else {
            let name = shortened(&row.name, 26);
            svg.text("cell-name", (left - 10.0, top + 15.0), Anchor::End, &name);
            svg.text("row-number", (left + length + 8.0, top + 15.0), Anchor::Start, &row.text);
        }
    }
    svg.line("axis-line", (left, 2.0), (left, rows.len() as f64 * height + 6.0));
    svg.finish(description)
}
