//! Curves with bands as small multiples on shared axes: one panel per sensor.

use super::{Axis, Frame, PANEL, drawable, extremes_in_words, shortened};
use crate::page::drawing::{Datum, Drawing};
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
const TOP: f64 = 22.0;
const BOTTOM: f64 = 38.0;

/// Approximate width of a letter of an axis label.
const LETTER: f64 = 6.4;

/// Largest number of letters of title and remark on one line of a panel.
const LETTERS: usize = 46;

/// Draws panels with the same axes, so that amplitudes can be compared; a single panel takes the full width.
pub fn small_multiples(panels: &[Panel], x: &Axis, y: &Axis, description: &str) -> Vec<Drawing> {
    let each: Vec<(&Panel, &Axis)> = panels.iter().map(|panel| (panel, x)).collect();
    multiples(&each, y, description)
}

/// Draws panels with the same vertical axis, each with a horizontal one of its own.
pub fn multiples(panels: &[(&Panel, &Axis)], y: &Axis, description: &str) -> Vec<Drawing> {
    let letters = |p: &Panel| p.title.chars().count() + p.remark.chars().count();
    let wrapped = panels.iter().any(|(p, _)| letters(p) > LETTERS);
    let one = |&(panel, x): &(&Panel, &Axis)| {
        let words = in_words(panel, (x, y), description);
        let draw = |width: f64| one_panel(panel, (x, y), (width, wrapped), &words);
        let labels = [x.label.as_str(), y.label.as_str()];
        if panels.len() == 1 {
            Drawing::wide(draw, labels, values(panel))
        } else {
            Drawing::panel(draw(PANEL), labels, values(panel))
        }
    };
    panels.iter().map(one).collect()
}

/// A panel of a width; `wrapped` leaves a second line for the remark.
fn one_panel(
    panel: &Panel,
    (x, y): (&Axis, &Axis),
    (width, wrapped): (f64, bool),
    words: &str,
) -> String {
    let height = if width > PANEL { 250.0 } else { 190.0 };
    // A label is written upwards beside the axis.
    let tall = LETTER * y.label.chars().count() as f64 + TOP + BOTTOM;
    let height = f64::max(height, tall.min(320.0));
    let top = if wrapped && width == PANEL { TOP + 15.0 } else { TOP };
    let mut svg = Svg::new(width, height + top - TOP);
    let area = Area::new(LEFT, top, width - LEFT - 10.0, height - TOP - BOTTOM);
    let most = if width > PANEL { x.ticks } else { x.ticks.min(5) };
    let x = x.clone().ticks(most);
    let frame = Frame::new(area, &x, y);
    frame.axes(&mut svg, &x, y);
    draw(&mut svg, panel, &frame, (&x, y));
    svg.finish(words)
}

/// A panel in a sentence: its title and remark, and the range of its last named curve.
fn in_words(panel: &Panel, axes: (&Axis, &Axis), description: &str) -> String {
    let named = panel.curves.iter().rev().find(|c| !c.name.is_empty() && drawable(&c.points));
    let range = named.map(|c| format!("{} {}", c.name, extremes_in_words(&c.points, axes)));
    let said = [Some(panel.remark.clone()), range].into_iter().flatten();
    let said: Vec<String> = said.filter(|text| !text.is_empty()).collect();
    let said = if said.is_empty() { "nothing measured".to_owned() } else { said.join("; ") };
    format!("{description}, {}: {said}", panel.title)
}

/// The drawn values.
fn values(panel: &Panel) -> Vec<Datum> {
    let curves = panel.curves.iter().flat_map(|curve| {
        let name = if curve.name.is_empty() { curve.class } else { &curve.name };
        let name = name.trim_start_matches("s-");
        curve.points.iter().map(move |&point| Datum::point(&panel.title, name, point))
    });
    let bands = panel.bands.iter().flat_map(|band| {
        let name = band.class.trim_start_matches("s-");
        band.edges.iter().map(move |&(x, low, high)| Datum {
            interval: Some((low, high)),
            ..Datum::point(&panel.title, name, (x, f64::NAN))
        })
    });
    curves.chain(bands).collect()
}

fn draw(svg: &mut Svg, panel: &Panel, frame: &Frame, (x, y): (&Axis, &Axis)) {
    let area = frame.area;
    svg.text("panel-title", (1.0, 14.0), Anchor::Start, &shortened(&panel.title, LETTERS));
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
