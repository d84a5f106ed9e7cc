//! The figures of the report, one kind per file, all drawn on the same frame.

mod bars;
mod design;
mod heat_map;
mod histogram;
mod lines;
mod pairs;
mod residual_map;
mod rows;
mod scatter;
mod trace;
mod triangle;

use super::number::{significant, typeset};
use super::scale::Scale;
use super::svg::{Anchor, Area, Svg};

pub use bars::{BarChart, BarSeries, Level};
pub use design::{DesignColumn, MOST_CROSSED, design_matrix};
pub use heat_map::correlation_map;
pub use histogram::{Marginal, Mark, SecondAxis, marginals};
pub use lines::{Band, Curve, Panel, multiples, small_multiples};
pub use pairs::{MOST_PAIRED, PairColumn, pair_matrix};
pub use residual_map::{Strip, residual_map};
pub use rows::{Row, row_chart};
pub use scatter::{agreement, dot_chart};
pub use trace::{Trace, traces};

/// Width of a drawing over the full width of the page, in its own units. Screens show a unit as about a pixel, so that
/// letters stay readable.
pub const WIDTH: f64 = 880.0;

/// Width of a panel, that of a phone's screen; three stand beside each other on a wide one.
pub const PANEL: f64 = 340.0;

/// Label, range and ticks of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Name with its unit; empty for an axis that shares the label of its neighbour.
    pub label: String,
    /// Range of values, lower and upper end.
    pub domain: (f64, f64),
    /// Approximate number of ticks; 0 draws none.
    pub ticks: usize,
    /// True if the ticks are labelled; false for an axis that shares the labels of its neighbour.
    pub numbers: bool,
    /// True for a logarithmic axis.
    pub logarithmic: bool,
}

impl Axis {
    /// An axis with about five ticks.
    pub fn new(label: impl Into<String>, domain: (f64, f64)) -> Self {
        Self { label: label.into(), domain, ticks: 5, numbers: true, logarithmic: false }
    }

    /// The axis, without label and tick labels unless `shown`.
    pub fn shown(&self, shown: bool) -> Self {
        if shown {
            self.clone()
        } else {
            Self { label: String::new(), numbers: false, ..self.clone() }
        }
    }

    /// Scale of the axis on a range of coordinates of the drawing.
    fn scale(&self, range: (f64, f64)) -> Scale {
        if self.logarithmic {
            Scale::logarithmic(self.domain, range)
        } else {
            Scale::linear(self.domain, range)
        }
    }

    /// The axis with another number of ticks.
    pub fn ticks(self, ticks: usize) -> Self {
        Self { ticks, ..self }
    }
}

/// Rectangle of a drawing with a horizontal and a vertical scale.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Rectangle inside the axes.
    pub area: Area,
    /// Horizontal scale.
    pub x: Scale,
    /// Vertical scale.
    pub y: Scale,
}

impl Frame {
    /// A frame on this rectangle with the scales of these axes.
    pub fn new(area: Area, x: &Axis, y: &Axis) -> Self {
        Self { area, x: x.scale((area.x, area.right())), y: y.scale((area.bottom(), area.y)) }
    }

    /// Coordinates in the drawing of a pair of values.
    pub fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.place(x), self.y.place(y))
    }

    /// Coordinates in the drawing of pairs of values.
    pub fn along(&self, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
        points.iter().map(|&p| self.at(p)).collect()
    }

    /// Draws grid lines, ticks, tick labels and axis labels.
    pub fn axes(&self, svg: &mut Svg, x: &Axis, y: &Axis) {
        let Area { x: left, y: top, .. } = self.area;
        let (right, bottom) = (self.area.right(), self.area.bottom());
        svg.group(&[("class", "y-ticks")], |svg| {
            for tick in ticks(&self.y, y.ticks) {
                let place = self.y.place(tick.value);
                svg.line("grid", (left, place), (right, place));
                if y.numbers {
                    svg.text("tick", (left - 5.0, place + 3.6), Anchor::End, &tick.label);
                }
            }
        });
        svg.group(&[("class", "x-ticks")], |svg| {
            for tick in ticks(&self.x, x.ticks) {
                let place = self.x.place(tick.value);
                svg.line("grid", (place, top), (place, bottom));
                if x.numbers {
                    svg.text("tick", (place, bottom + 14.0), Anchor::Middle, &tick.label);
                }
            }
        });
        svg.rectangle("frame", self.area, "");
        let middle = (left + 0.5 * self.area.width, top + 0.5 * self.area.height);
        if !x.label.is_empty() {
            svg.text("axis", (middle.0, bottom + 30.0), Anchor::Middle, &x.label);
        }
        if !y.label.is_empty() {
            svg.upward_text("axis", (left - 44.0, middle.1), &y.label);
        }
    }

    /// Adds the output of `draw`, clipped at the frame, with the attributes from which the page's read-out takes its
    /// values.
    pub fn inside(&self, svg: &mut Svg, x: &Axis, y: &Axis, draw: impl FnOnce(&mut Svg)) {
        let (left, right) = (self.area.x, self.area.right());
        let (bottom, top) = (self.area.bottom(), self.area.y);
        let across = describe((left, right), &self.x);
        let along = describe((bottom, top), &self.y);
        let counts = format!("{} {}", x.ticks, if y.numbers { y.ticks } else { 0 });
        let attributes = [
            ("class", "plot"),
            ("data-x", across.as_str()),
            ("data-y", along.as_str()),
            ("data-x-label", x.label.as_str()),
            ("data-y-label", y.label.as_str()),
            ("data-ticks", counts.as_str()),
        ];
        svg.group(&attributes, |svg| {
            svg.rectangle("hit", self.area, "");
            svg.clipped(self.area, draw);
        });
    }
}

fn ticks(scale: &Scale, count: usize) -> Vec<crate::page::scale::Tick> {
    if count == 0 { Vec::new() } else { scale.ticks(count) }
}

/// A scale for the page's script: two coordinates of the drawing, and the values there.
fn describe(range: (f64, f64), scale: &Scale) -> String {
    let domain = scale.domain();
    let kind = if scale.is_logarithmic() { " log" } else { "" };
    format!("{} {} {:e} {:e}{kind}", range.0, range.1, domain.0, domain.1)
}

/// Appearance of a legend entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Swatch {
    /// A line.
    Line,
    /// A filled area.
    Area,
    /// A dot.
    Dot,
}

impl Swatch {
    /// Name by which the page's script knows the appearance.
    pub fn name(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Area => "area",
            Self::Dot => "dot",
        }
    }
}

/// Entry of the legend of a figure; it has the CSS class of the shapes that it names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Key {
    /// CSS class of the shapes.
    pub class: &'static str,
    /// Appearance of the entry.
    pub swatch: Swatch,
    /// Label of the shapes.
    pub label: String,
}

impl Key {
    /// A legend entry for lines.
    pub fn line(class: &'static str, label: impl Into<String>) -> Self {
        Self { class, swatch: Swatch::Line, label: label.into() }
    }

    /// A legend entry for filled areas.
    pub fn area(class: &'static str, label: impl Into<String>) -> Self {
        Self { class, swatch: Swatch::Area, label: label.into() }
    }

    /// A legend entry for dots.
    pub fn dot(class: &'static str, label: impl Into<String>) -> Self {
        Self { class, swatch: Swatch::Dot, label: label.into() }
    }
}

/// Returns true if at least one point is finite.
fn drawable(points: &[(f64, f64)]) -> bool {
    points.iter().any(|(x, y)| x.is_finite() && y.is_finite())
}

/// A title shortened to the width of a panel.
fn shortened(text: &str, letters: usize) -> String {
    if text.chars().count() <= letters {
        return text.to_owned();
    }
    text.chars().take(letters.saturating_sub(1)).chain(['…']).collect()
}

/// A sentence on the largest and the smallest value of a curve and where they are; empty if it has none.
fn extremes_in_words(points: &[(f64, f64)], (x, y): (&Axis, &Axis)) -> String {
    let known = || points.iter().filter(|(x, y)| x.is_finite() && y.is_finite());
    let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
    let (Some(low), Some(high)) = (known().min_by(by_value), known().max_by(by_value)) else {
        return String::new();
    };
    let words = |label: &str, value: f64| with_unit(label, &typeset(&significant(value, 3)));
    let [low, high] =
        [low, high].map(|p| format!("{} at {}", words(&y.label, p.1), words(&x.label, p.0)));
    format!("from {low} to {high}")
}

/// A number with the name and the unit of an axis, such as `time 0.35 ms`.
fn with_unit(label: &str, number: &str) -> String {
    match label.strip_suffix(']').and_then(|label| label.rsplit_once(" [")) {
        Some((name, unit)) => format!("{name} {number} {unit}"),
        None => format!("{label} {number}"),
    }
}
