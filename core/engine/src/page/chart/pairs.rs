//! Pairwise posterior: hexagonal bins below the diagonal, densities on it.

use std::collections::BTreeMap;

use super::triangle::{Cell, triangle};
use super::{Axis, Frame, Mark, shortened};
use crate::page::curve::{quantile, smooth_density, sorted};
use crate::page::drawing::{Datum, Drawing};
use crate::page::scale::{extent, padded};
use crate::page::svg::{Anchor, Area, Path, Svg};

/// One coordinate of the posterior, in the displayed unit.
#[derive(Debug, Clone, PartialEq)]
pub struct PairColumn {
    /// Index of the coordinate among all.
    pub index: usize,
    /// Name of the coordinate with its unit.
    pub label: String,
    /// Draws after the burn-in.
    pub draws: Vec<f64>,
    /// Effective sample size of the draws.
    pub effective: f64,
    /// Values marked in every cell; all columns have the same marks in the same order.
    pub marks: Vec<Mark>,
}

/// Largest number of coordinates in pairs.
pub const MOST_PAIRED: usize = 12;

/// Largest number of coordinates whose cells have room for long names, and letters of a name in smaller cells.
const WIDE: usize = 6;
const LETTERS: usize = 23;

/// Smallest width of a hexagon.
const NARROWEST: f64 = 9.0;

/// Number of shades of the hexagons, from rare to frequent.
const SHADES: usize = 6;

/// Draws all pairs of coordinates below the diagonal.
pub fn pair_matrix(columns: &[PairColumn], description: &str) -> Drawing {
    let n = columns.len().min(MOST_PAIRED);
    let axes: Vec<Axis> = columns[..n].iter().map(|column| axis(column, n)).collect();
    let thinned = |column: &PairColumn| {
        let stride = (n * column.draws.len()).div_ceil(MOST_LISTED).max(1);
        let each = column.draws.iter().enumerate().step_by(stride);
        let number =
            |(i, value): (usize, &f64)| Datum::point(&column.label, "draw", (i as f64, *value));
        each.map(number).collect::<Vec<_>>()
    };
    let values = columns[..n].iter().flat_map(thinned).collect();
    let svg = triangle(&axes, description, |svg, cell| match cell {
        Cell::Diagonal { index, area, shown } => {
            draw_density(svg, area, &columns[index], &axes[index], &shown);
        }
        Cell::Pair { x, y, frame } => {
            let places = [columns[x].index.to_string(), columns[y].index.to_string()];
            let attributes = [("data-column", places[0].as_str()), ("data-row", &places[1])];
            svg.group(&attributes, |svg| {
                frame.inside(svg, &axes[x], &axes[y], |svg| {
                    draw_hexagons(svg, &frame, &columns[x].draws, &columns[y].draws);
                    draw_marks(svg, &frame, &columns[x].marks, &columns[y].marks);
                });
            });
        }
    });
    Drawing::scrolled(svg, ["number of the draw", "value"], values)
}

/// Approximate number of values that are listed in the table of values.
const MOST_LISTED: usize = 6000;

/// Axis over all but the outermost 0.1 % of the draws, so that a few stray draws do not shrink the rest.
/// Among many coordinates there is room for fewer letters.
fn axis(column: &PairColumn, among: usize) -> Axis {
    let sorted = sorted(&column.draws);
    let domain = extent([quantile(&sorted, 0.0005), quantile(&sorted, 0.9995)]);
    let domain = padded(domain.unwrap_or((0.0, 1.0)), 0.12);
    if among > WIDE {
        Axis::new(shortened(&column.label, LETTERS), domain).ticks(3)
    } else {
        Axis::new(column.label.as_str(), domain).ticks(4)
    }
}

fn draw_density(svg: &mut Svg, area: Area, column: &PairColumn, domain: &Axis, shown: &Axis) {
    let curve = smooth_density(&column.draws, column.effective, 128);
    let highest = curve.iter().map(|p| p.1).fold(0.0, f64::max);
    let y = Axis::new("", (0.0, 1.15 * highest)).ticks(0);
    let frame = Frame::new(area, domain, &y);
    frame.axes(svg, shown, &y);
    svg.clipped(area, |svg| {
        let outline = frame.along(&curve);
        let base: Vec<_> = curve.iter().map(|&(x, _)| frame.at((x, 0.0))).collect();
        svg.path("s-density-area", &Path::band(&outline, &base), "");
        svg.path("line s-density", &Path::through(outline), "");
        for mark in column.marks.iter().filter(|m| m.value.is_finite()) {
            let place = frame.x.place(mark.value);
            svg.line(&format!("line {}", mark.class), (place, area.y), (place, area.bottom()));
        }
    });
    svg.text("panel-title", (area.x, area.y - 5.0), Anchor::Start, &domain.label);
}

fn draw_marks(svg: &mut Svg, frame: &Frame, across: &[Mark], along: &[Mark]) {
    for (x, y) in across.iter().zip(along) {
        let (cx, cy) = frame.at((x.value, y.value));
        let cross = Path::through([
            (cx - 6.0, cy),
            (cx + 6.0, cy),
            (f64::NAN, 0.0),
            (cx, cy - 6.0),
            (cx, cy + 6.0),
        ]);
        svg.path("cross-halo", &cross, "");
        svg.path(&format!("cross {}", x.class), &cross, &x.label);
    }
}

/// Draws the counts in hexagonal bins, one path per shade.
///
/// The nearest point of two interleaved rectangular lattices is the nearest centre of a hexagonal lattice (Carr,
/// Littlefield, Nicholson and Littlefield, JASA 82, 1987).
fn draw_hexagons(svg: &mut Svg, frame: &Frame, x: &[f64], y: &[f64]) {
    let width = (frame.area.width / 22.0).max(NARROWEST);
    let height = width * 3.0_f64.sqrt();
    let mut counts: BTreeMap<(i64, i64, bool), usize> = BTreeMap::new();
    for point in x.iter().zip(y).map(|(&x, &y)| frame.at((x, y))) {
        if point.0.is_finite() && point.1.is_finite() {
            *counts.entry(nearest((point.0 / width, point.1 / height))).or_default() += 1;
        }
    }
    let most = counts.values().copied().max().unwrap_or(1) as f64;
    let mut shades = vec![Vec::new(); SHADES];
    for ((column, row, shifted), count) in counts {
        let shift = if shifted { 0.5 } else { 0.0 };
        let centre = ((column as f64 + shift) * width, (row as f64 + shift) * height);
        // The shade follows the square root of the count, so that the tails remain visible beside the peak.
        let shade = ((count as f64 / most).sqrt() * SHADES as f64).ceil() as usize;
        shades[shade.clamp(1, SHADES) - 1].push(hexagon(centre, width));
    }
    for (i, outlines) in shades.into_iter().enumerate() {
        svg.path(&format!("hex h-{}", i + 1), &Path::polygons(outlines), "");
    }
}

fn nearest((x, y): (f64, f64)) -> (i64, i64, bool) {
    let distance = |cx: f64, cy: f64| (x - cx).powi(2) + 3.0 * (y - cy).powi(2);
    let plain = (x.round(), y.round());
    let shifted = (x.floor(), y.floor());
    if distance(plain.0, plain.1) <= distance(shifted.0 + 0.5, shifted.1 + 0.5) {
        (plain.0 as i64, plain.1 as i64, false)
    } else {
        (shifted.0 as i64, shifted.1 as i64, true)
    }
}

/// Corners of a hexagon with a vertex at the top, `width` wide.
fn hexagon((x, y): (f64, f64), width: f64) -> Vec<(f64, f64)> {
    let radius = width / 3.0_f64.sqrt();
    (0..6)
        .map(|k| (f64::from(k) * 60.0 + 30.0).to_radians())
        .map(|angle| (x + radius * angle.cos(), y + radius * angle.sin()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a hexagonal lattice, the search finds the nearest centre of every point.
    #[test]
    fn the_nearest_hexagon_is_found() {
        let centre = |(column, row, shifted): (i64, i64, bool)| {
            let shift = if shifted { 0.5 } else { 0.0 };
            (column as f64 + shift, row as f64 + shift)
        };
        let distance =
            |p: (f64, f64), c: (f64, f64)| (p.0 - c.0).powi(2) + 3.0 * (p.1 - c.1).powi(2);
        for i in 0..400 {
            let p = (f64::from(i % 20) * 0.17 - 1.5, f64::from(i / 20) * 0.13 - 1.1);
            let found = distance(p, centre(nearest(p)));
            for column in -3..5 {
                for row in -3..5 {
                    for shifted in [false, true] {
                        assert!(found <= distance(p, centre((column, row, shifted))) + 1e-12);
                    }
                }
            }
        }
    }
}
