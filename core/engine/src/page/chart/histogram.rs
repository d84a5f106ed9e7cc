//! Marginal distributions: histogram, prior, fitted distribution, and marks.

use super::{Axis, Curve, Frame, PANEL, shortened};
use crate::page::curve::Histogram;
use crate::page::drawing::{Datum, Drawing};
use crate::page::number::{significant, typeset};
use crate::page::scale::{Scale, extent, padded};
use crate::page::svg::{Anchor, Area, Path, Svg};

/// Value marked on the horizontal axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// CSS class of the line.
    pub class: &'static str,
    /// Short label of the mark.
    pub label: String,
    /// Value that is marked, in the unit of the axis.
    pub value: f64,
}

/// Second horizontal axis above the frame, which shows a transformation of the same values.
#[derive(Debug, Clone)]
pub struct SecondAxis {
    /// Label of the axis.
    pub label: String,
    /// Map from a value of the second axis to one of the first.
    pub to_first: fn(f64) -> f64,
    /// Map from a value of the first axis to one of the second.
    pub from_first: fn(f64) -> f64,
    /// Factor by which a tick of the second axis is multiplied before `to_first` is applied.
    pub factor: f64,
}

/// Content of one panel; all values are in the displayed unit.
#[derive(Debug, Clone)]
pub struct Marginal {
    /// Title of the panel.
    pub title: String,
    /// Remark beside the title.
    pub remark: String,
    /// Label of the horizontal axis.
    pub label: String,
    /// Label of the vertical axis.
    pub density_label: String,
    /// Draws of which the histogram is made.
    pub draws: Vec<f64>,
    /// Density curves.
    pub curves: Vec<Curve>,
    /// Marks; one outside the axis range is labelled at the edge instead.
    pub marks: Vec<Mark>,
    /// Second horizontal axis.
    pub second: Option<SecondAxis>,
}

const LEFT: f64 = 64.0;
const TOP: f64 = 40.0;
/// Height reserved for the second axis.
const SECOND: f64 = 32.0;
const HEIGHT: f64 = 240.0;
const BOTTOM: f64 = 38.0;

/// Draws panels of marginal distributions, each with its own axes.
pub fn marginals(panels: &[Marginal], description: &str) -> Vec<Drawing> {
    let second = if panels.iter().any(|p| p.second.is_some()) { SECOND } else { 0.0 };
    panels.iter().map(|panel| one(panel, second, description)).collect()
}

/// One panel; `second` is the height that the figure reserves for second axes.
fn one(panel: &Marginal, second: f64, description: &str) -> Drawing {
    let histogram = Histogram::of(&panel.draws, 60);
    let mut svg = Svg::new(PANEL, HEIGHT + second);
    let top = TOP + second;
    draw(
        &mut svg,
        panel,
        histogram.as_ref(),
        Area::new(LEFT, top, PANEL - LEFT - 10.0, HEIGHT - TOP - BOTTOM),
    );
    let bins = histogram.iter().flat_map(Histogram::bins);
    let values = bins.map(|(left, right, density)| {
        Datum::point(&panel.title, "histogram", (0.5 * (left + right), density))
    });
    let curves = panel.curves.iter().flat_map(|curve| {
        curve.points.iter().map(|&point| Datum::point(&panel.title, &curve.name, point))
    });
    let marks: Vec<&str> = panel.marks.iter().map(|mark| mark.label.as_str()).collect();
    let sorted = crate::page::curve::sorted(&panel.draws);
    let [low, middle, high] = [0.025, 0.5, 0.975]
        .map(|p| typeset(&significant(crate::page::curve::quantile(&sorted, p), 3)));
    let words = format!(
        "{description}, {}: median {middle}, 95 % of the draws from {low} to {high}; {}",
        panel.label,
        marks.join(", ")
    );
    let values = values.chain(curves).collect();
    Drawing::panel(svg.finish(&words), [&panel.label, &panel.density_label], values)
}

fn draw(svg: &mut Svg, panel: &Marginal, histogram: Option<&Histogram>, area: Area) {
    let bins = || histogram.into_iter().flat_map(Histogram::bins);
    let domain = extent(bins().flat_map(|(l, r, _)| [l, r]));
    let domain = padded(domain.unwrap_or((0.0, 1.0)), 0.12);
    let highest = bins().map(|(_, _, density)| density).fold(0.0, f64::max);
    let x = Axis::new(panel.label.as_str(), domain).ticks(4);
    let y = Axis::new(panel.density_label.as_str(), (0.0, 1.15 * highest)).ticks(4);
    let frame = Frame::new(area, &x, &y);
    svg.text("panel-title", (1.0, 13.0), Anchor::Start, &shortened(&panel.title, 46));
    svg.text("remark", (area.right(), 29.0), Anchor::End, &panel.remark);
    frame.axes(svg, &x, &y);
    frame.inside(svg, &x, &y, |svg| {
        for (left, right, density) in bins() {
            let (x0, y0) = frame.at((left, density));
            let (x1, y1) = frame.at((right, 0.0));
            svg.rectangle("s-histogram", Area::new(x0, y0, x1 - x0, y1 - y0), "");
        }
        for curve in &panel.curves {
            let path = Path::through(frame.along(&curve.points));
            svg.path(&format!("line {}", curve.class), &path, &curve.name);
        }
        draw_marks(svg, &frame, &panel.marks);
    });
    if let Some(second) = &panel.second {
        svg.group(&[("class", "second")], |svg| draw_second(svg, &frame, second));
    }
}

/// Vertical lines with labels at staggered heights; an arrow at the edge marks a value beyond it.
fn draw_marks(svg: &mut Svg, frame: &Frame, marks: &[Mark]) {
    let (low, high) = frame.x.domain();
    let area = frame.area;
    for (i, mark) in marks.iter().filter(|m| m.value.is_finite()).enumerate() {
        let text_y = area.y + 13.0 + 14.0 * i as f64;
        // The left one of two adjacent marks is labelled on its left, so that the labels do not overlap.
        let is_left = marks.iter().any(|other| other.value > mark.value);
        let label = format!("label {}", mark.class);
        if mark.value < low {
            svg.text(&label, (area.x + 4.0, text_y), Anchor::Start, &format!("◂ {}", mark.label));
        } else if mark.value > high {
            let text = format!("{} ▸", mark.label);
            svg.text(&label, (area.right() - 4.0, text_y), Anchor::End, &text);
        } else {
            let place = frame.x.place(mark.value);
            svg.line(&format!("line {}", mark.class), (place, area.y), (place, area.bottom()));
            let width = 7.0 * mark.label.chars().count() as f64;
            let (before, after) = (place - area.x > width, area.right() - place > width);
            let (shift, anchor) = if before && (is_left || !after) {
                (-4.0, Anchor::End)
            } else {
                (4.0, Anchor::Start)
            };
            svg.text(&label, (place + shift, text_y), anchor, &mark.label);
        }
    }
}

fn draw_second(svg: &mut Svg, frame: &Frame, second: &SecondAxis) {
    let area = frame.area;
    let (low, high) = frame.x.domain();
    let ends = ((second.from_first)(low.max(0.0)), (second.from_first)(high));
    for tick in Scale::linear((ends.0 / second.factor, ends.1 / second.factor), (0.0, 1.0)).ticks(5)
    {
        let place = frame.x.place((second.to_first)(tick.value * second.factor));
        svg.line("tick-mark", (place, area.y - 4.0), (place, area.y));
        svg.text("tick", (place, area.y - 7.0), Anchor::Middle, &tick.label);
    }
    let middle = area.x + 0.5 * area.width;
    svg.text("axis", (middle, area.y - 23.0), Anchor::Middle, &second.label);
}
