//! Residuals along curves as coloured strips, one per curve, with outlined intervals.

use super::{Axis, Frame, PANEL, shortened, with_unit};
use crate::page::drawing::{Datum, Drawing};
use crate::page::number::{fixed, significant, typeset};
use crate::page::svg::{Anchor, Area, Svg};

/// One strip of the map.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    /// Name of the curve.
    pub name: String,
    /// Points `(x, value)` along the axis.
    pub points: Vec<(f64, f64)>,
    /// Intervals on the axis that are outlined, first and last place.
    pub outlines: Vec<(f64, f64)>,
}

/// Width reserved for the names beside the strips.
const NAMES: f64 = 130.0;
const HEIGHT: f64 = 20.0;
/// Largest number of cells of a strip.
const CELLS: usize = 120;
/// Increase of the value per step of colour.
const STEP: f64 = 1.2;

/// Draws the map; blue is positive, red negative, and the darkest colour stands for values of six or more.
pub fn residual_map(strips: &[Strip], x: &Axis, description: &str) -> Drawing {
    let all = || strips.iter().flat_map(|strip| strip.points.iter().map(move |p| (strip, p)));
    let known = all().filter(|(_, p)| p.1.is_finite());
    let largest = known.max_by(|a, b| a.1.1.abs().total_cmp(&b.1.1.abs()));
    let said = largest.map_or_else(String::new, |(strip, &(at, value))| {
        let at = with_unit(&x.label, &typeset(&significant(at, 3)));
        format!(": the largest is {} at {}, {at}", typeset(&fixed(value, 1)), strip.name)
    });
    let words = format!("{description}{said}");
    let values =
        all().map(|(strip, &point)| Datum::point(&strip.name, "residual", point)).collect();
    let labels = [x.label.as_str(), "residual [standard deviations]"];
    Drawing::wide(|width| sized(strips, x, width, &words), labels, values)
}

fn sized(strips: &[Strip], x: &Axis, width: f64, description: &str) -> String {
    let names = if width > PANEL { NAMES } else { 78.0 };
    let most = if width > PANEL { CELLS } else { CELLS / 2 };
    let height = strips.len() as f64 * HEIGHT;
    let area = Area::new(names, 6.0, width - names - 12.0, height);
    let y = Axis::new("", (0.0, strips.len().max(1) as f64)).ticks(0);
    let x = &x.clone().ticks(if width > PANEL { x.ticks } else { x.ticks.min(4) });
    let frame = Frame::new(area, x, &y);
    let mut svg = Svg::new(width, height + 46.0);
    frame.axes(&mut svg, x, &y);
    let longest = strips.iter().map(|strip| strip.points.len()).max().unwrap_or(0);
    let cells = longest.clamp(1, most);
    for (i, strip) in strips.iter().enumerate() {
        let top = area.y + i as f64 * HEIGHT;
        let name = shortened(&strip.name, ((names - 8.0) / 6.4) as usize);
        svg.text("tick", (names - 8.0, top + 0.5 * HEIGHT + 4.0), Anchor::End, &name);
        let width = area.width / cells as f64;
        // The page's script finds the cell of a place by these.
        let told = [
            ("data-ends", format!("{:e} {:e}", x.domain.0, x.domain.1)),
            ("data-cells", cells.to_string()),
            ("data-left", area.x.to_string()),
            ("data-width", width.to_string()),
        ];
        let told = told.iter().map(|(name, value)| (*name, value.as_str()));
        let attributes: Vec<_> = told.chain([("data-strip", strip.name.as_str())]).collect();
        svg.group(&attributes, |svg| {
            for (k, value) in extremes(strip, x.domain, cells).into_iter().enumerate() {
                let Some((at, value)) = value else { continue };
                let left = area.x + k as f64 * width;
                let cell = Area::new(left, top + 1.0, width + 0.3, HEIGHT - 2.0);
                let hint = format!(
                    "{}, {}: {}",
                    strip.name,
                    with_unit(&x.label, &typeset(&significant(at, 3))),
                    typeset(&fixed(value, 1))
                );
                svg.rectangle(&format!("strip {}", shade(value)), cell, &hint);
            }
        });
    }
    for (i, strip) in strips.iter().enumerate() {
        for &(from, to) in &strip.outlines {
            let (left, right) = (frame.x.place(from), frame.x.place(to));
            let (left, right) = (left - 2.0, right.max(left + 3.0) + 2.0);
            let top = area.y + i as f64 * HEIGHT;
            svg.rectangle("outline", Area::new(left, top, right - left, HEIGHT), "");
        }
    }
    svg.finish(description)
}

/// Value farthest from zero in each cell, with its place; `None` for an empty cell.
fn extremes(strip: &Strip, (low, high): (f64, f64), cells: usize) -> Vec<Option<(f64, f64)>> {
    let mut found: Vec<Option<(f64, f64)>> = vec![None; cells];
    let length = if high > low { high - low } else { 1.0 };
    for &(at, value) in strip.points.iter().filter(|p| p.1.is_finite()) {
        let share = (at - low) / length * (cells as f64 - 1.0);
        let cell = &mut found[(share.round().max(0.0) as usize).min(cells - 1)];
        if cell.is_none_or(|(_, largest)| value.abs() > largest.abs()) {
            *cell = Some((at, value));
        }
    }
    found
}

fn shade(value: f64) -> String {
    let step = ((value.abs() / STEP).round() as i64).min(5);
    match (step, value < 0.0) {
        (0, _) => String::from("c-0"),
        (step, true) => format!("c-minus-{step}"),
        (step, false) => format!("c-plus-{step}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_shows_its_largest_value() {
        let points = (0..1000).map(|i| (f64::from(i), if i == 500 { -9.0 } else { 0.1 })).collect();
        let strip = Strip { name: "A".into(), points, outlines: Vec::new() };
        let cells = extremes(&strip, (0.0, 999.0), 100);
        assert_eq!(cells.iter().filter(|c| c.is_some_and(|c| c == (500.0, -9.0))).count(), 1);
        assert_eq!(shade(-9.0), "c-minus-5");
        assert_eq!(shade(0.1), "c-0");
    }
}
