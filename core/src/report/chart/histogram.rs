//! Marginals: a histogram with its prior, a fitted distribution, and marks.

use super::{Axis, Curve, Frame, WIDTH};
use crate::report::curve::Histogram;
use crate::report::scale::{Scale, extent, padded};
use crate::report::svg::{Anchor, Area, Path, Svg};

/// A number marked on the horizontal axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// The class of its line.
    pub class: &'static str,
    /// What it is, in short.
    pub label: String,
    /// Where it is.
    pub value: f64,
}

/// A second horizontal axis above the frame, for another reading of the same numbers.
#[derive(Debug, Clone)]
pub struct SecondAxis {
    /// Its label.
    pub label: String,
    /// From a number of the second axis to one of the first.
    pub to_first: fn(f64) -> f64,
    /// From a number of the first axis to one of the second.
    pub from_first: fn(f64) -> f64,
    /// What a number of the second axis is multiplied by in `to_first`'s result.
    pub factor: f64,
}

/// What one panel shows; all numbers are in the shown unit.
#[derive(Debug, Clone)]
pub struct Marginal {
    /// Its title.
    pub title: String,
    /// A remark beside the title.
    pub remark: String,
    /// The label of the horizontal axis.
    pub label: String,
    /// The label of the vertical axis.
    pub density_label: String,
    /// The draws.
    pub draws: Vec<f64>,
    /// Density curves.
    pub curves: Vec<Curve>,
    /// Marks; one outside the axis is told at the edge instead.
    pub marks: Vec<Mark>,
    /// Another reading of the horizontal axis.
    pub second: Option<SecondAxis>,
}

const LEFT: f64 = 62.0;
const GAP: f64 = 76.0;
const TOP: f64 = 26.0;
/// The room of the second axis.
const SECOND: f64 = 32.0;
const ROW: f64 = 236.0;
const BOTTOM: f64 = 44.0;

/// Panels of marginals, two a row, each on its own axes.
pub fn marginals(panels: &[Marginal], description: &str) -> String {
    let columns = panels.len().clamp(1, 2);
    let rows = panels.len().div_ceil(columns);
    let width = (WIDTH - LEFT - 10.0 - (columns - 1) as f64 * GAP) / columns as f64;
    let second = if panels.iter().any(|p| p.second.is_some()) { SECOND } else { 0.0 };
    let row_height = ROW + second;
    let mut svg = Svg::new(WIDTH, rows as f64 * row_height);
    for (i, panel) in panels.iter().enumerate() {
        let left = LEFT + (i % columns) as f64 * (width + GAP);
        let top = (i / columns) as f64 * row_height + TOP + second;
        draw(&mut svg, panel, Area::new(left, top, width, ROW - TOP - BOTTOM));
    }
    svg.finish(description)
}

fn draw(svg: &mut Svg, panel: &Marginal, area: Area) {
    let histogram = Histogram::of(&panel.draws, 60);
    let domain = histogram.as_ref().and_then(|h| extent(h.bins().flat_map(|(l, r, _)| [l, r])));
    let domain = padded(domain.unwrap_or((0.0, 1.0)), 0.12);
    let densities = histogram.iter().flat_map(|h| h.density.iter().copied());
    let highest = densities.fold(0.0, f64::max);
    let x = Axis::new(panel.label.as_str(), domain);
    let y = Axis::new(panel.density_label.as_str(), (0.0, 1.15 * highest)).ticks(4);
    let frame = Frame::new(area, &x, &y);
    let title_y = area.y - 9.0 - if panel.second.is_some() { SECOND } else { 0.0 };
    svg.text("panel-title", (area.x, title_y), Anchor::Start, &panel.title);
    svg.text("remark", (area.right(), title_y), Anchor::End, &panel.remark);
    frame.axes(svg, &x, &y);
    frame.inside(svg, &x, &y, |svg| {
        for (left, right, density) in histogram.iter().flat_map(Histogram::bins) {
            let (x0, y0) = frame.at((left, density));
            let (x1, y1) = frame.at((right, 0.0));
            svg.rectangle("s-histogram", Area::new(x0, y0, x1 - x0, y1 - y0), "");
        }
        for curve in &panel.curves {
            let path = Path::through(frame.along(&curve.points));
            svg.path(&format!("line {}", curve.class), &path, &curve.name);
        }
    });
    if let Some(second) = &panel.second {
        draw_second(svg, &frame, second);
    }
    draw_marks(svg, &frame, &panel.marks);
}

/// Vertical lines with labels at staggered heights; an arrow at the edge for what lies beyond.
fn draw_marks(svg: &mut Svg, frame: &Frame, marks: &[Mark]) {
    let (low, high) = frame.x.domain();
    let area = frame.area;
    for (i, mark) in marks.iter().filter(|m| m.value.is_finite()).enumerate() {
        let text_y = area.y + 13.0 + 14.0 * i as f64;
        let label = format!("label {}", mark.class);
        if mark.value < low {
            svg.text(&label, (area.x + 4.0, text_y), Anchor::Start, &format!("◂ {}", mark.label));
        } else if mark.value > high {
            let text = format!("{} ▸", mark.label);
            svg.text(&label, (area.right() - 4.0, text_y), Anchor::End, &text);
        } else {
            let place = frame.x.place(mark.value);
            svg.line(&format!("line {}", mark.class), (place, area.y), (place, area.bottom()));
            let on_the_right = place < area.x + 0.6 * area.width;
            let (shift, anchor) =
                if on_the_right { (4.0, Anchor::Start) } else { (-4.0, Anchor::End) };
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
