//! Curves with bands as small multiples on shared axes: one panel per sensor.

use super::{Axis, Frame, WIDTH, drawable};
use crate::page::svg::{Anchor, Area, Path, Svg};

/// Area between two curves.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// CSS class of the area.
    pub class: &'static str,
    /// Abscissa, lower and upper edge; a point without finite edges interrupts the band.
    pub edges: Vec<(f64, f64, f64)>,
}

/// Curve; a point that is not finite interrupts it.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// CSS class of the line.
    pub class: &'static str,
    /// Name shown in the read-out; empty for one of many similar curves.
    pub name: String,
    /// Points `(x, y)`, in the displayed units.
    pub points: Vec<(f64, f64)>,
}

/// One panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Title of the panel.
    pub title: String,
    /// Remark beside the title, such as an accuracy.
    pub remark: String,
    /// Bands, drawn below the curves.
    pub bands: Vec<Band>,
    /// Curves, in drawing order.
    pub curves: Vec<Curve>,
}

const LEFT: f64 = 60.0;
const GAP: f64 = 20.0;
const TOP: f64 = 22.0;
const BOTTOM: f64 = 34.0;

/// Number of rows in one drawing; further rows start a new drawing, so that each fits on a sheet of paper.
const SHEET_ROWS: usize = 6;

/// Draws panels in a grid, all with the same axes, so that amplitudes can be compared; returns one drawing per sheet.
pub fn small_multiples(panels: &[Panel], x: &Axis, y: &Axis, description: &str) -> Vec<String> {
    panels.chunks(2 * SHEET_ROWS).map(|panels| sheet(panels, x, y, description)).collect()
}

fn sheet(panels: &[Panel], x: &Axis, y: &Axis, description: &str) -> String {
    let columns = if panels.len() == 1 { 1 } else { 2 };
    let rows = panels.len().div_ceil(columns);
    let row_height = if rows == 1 { 250.0 } else { 142.0 };
    let width = (WIDTH - LEFT - 10.0 - (columns - 1) as f64 * GAP) / columns as f64;
    let mut svg = Svg::new(WIDTH, rows as f64 * row_height + BOTTOM);
    for (i, panel) in panels.iter().enumerate() {
        let (row, column) = (i / columns, i % columns);
        let left = LEFT + column as f64 * (width + GAP);
        let area = Area::new(left, row as f64 * row_height + TOP, width, row_height - TOP - 4.0);
        let frame = Frame::new(area, x, y);
        frame.axes(&mut svg, &x.shown(i + columns >= panels.len()), &y.shown(column == 0));
        draw(&mut svg, panel, &frame, (x, y));
    }
    svg.finish(description)
}

fn draw(svg: &mut Svg, panel: &Panel, frame: &Frame, (x, y): (&Axis, &Axis)) {
    let area = frame.area;
    svg.text("panel-title", (area.x + 1.0, area.y - 6.0), Anchor::Start, &panel.title);
    svg.text("remark", (area.right() - 1.0, area.y - 6.0), Anchor::End, &panel.remark);
    if !panel.curves.iter().any(|c| drawable(&c.points)) {
        let middle = (area.x + 0.5 * area.width, area.y + 0.5 * area.height);
        svg.text("remark", middle, Anchor::Middle, "nothing measured");
        return;
    }
    frame.inside(svg, x, y, |svg| {
        for band in &panel.bands {
            for piece in pieces(&band.edges) {
                if let [(x, low, high)] = piece {
                    svg.line("edge", frame.at((*x, *low)), frame.at((*x, *high)));
                    continue;
                }
                let upper: Vec<_> = piece.iter().map(|&(x, _, high)| frame.at((x, high))).collect();
                let lower: Vec<_> = piece.iter().map(|&(x, low, _)| frame.at((x, low))).collect();
                svg.path(band.class, &Path::band(&upper, &lower), "");
            }
        }
        for curve in &panel.curves {
            let path = Path::through(frame.along(&curve.points));
            svg.path(&format!("line {}", curve.class), &path, &curve.name);
            for point in lonely(&curve.points) {
                svg.circle(&format!("point {}", curve.class), frame.at(point), 2.2, &curve.name);
            }
        }
    });
}

/// Uninterrupted pieces of a band; a piece of a single point is drawn as a bar.
fn pieces(edges: &[(f64, f64, f64)]) -> impl Iterator<Item = &[(f64, f64, f64)]> {
    edges
        .split(|(x, low, high)| !(x.is_finite() && low.is_finite() && high.is_finite()))
        .filter(|piece| !piece.is_empty())
}

/// Points without a neighbour, which a line would not show.
fn lonely(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points
        .split(|(x, y)| !(x.is_finite() && y.is_finite()))
        .filter_map(|piece| if let [point] = piece { Some(*point) } else { None })
        .collect()
}
