//! Traces of many chains, with the marginal density beside them on the same vertical axis.

use super::{Axis, Frame, Mark, PANEL, shortened};
use crate::page::curve::{quantile, smooth_density, sorted};
use crate::page::drawing::{Datum, Drawing};
use crate::page::number::{significant, typeset};
use crate::page::scale::{extent, padded};
use crate::page::svg::{Anchor, Area, Path, Svg};

/// Trace of one coordinate, in the displayed unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Title of the row: the name of the coordinate.
    pub title: String,
    /// Label of the vertical axis.
    pub label: String,
    /// Values of each chain at the steps of [`Trace::steps`].
    pub chains: Vec<Vec<f64>>,
    /// Number of each chain, from zero.
    pub numbers: Vec<usize>,
    /// One entry per chain, true if the chain is stranded.
    pub stranded: Vec<bool>,
    /// Steps at which the values were taken.
    pub steps: Vec<usize>,
    /// First step after the burn-in.
    pub burn_in: usize,
    /// Draws of all chains after the burn-in.
    pub kept: Vec<f64>,
    /// Effective sample size of those draws.
    pub effective: f64,
    /// Values marked by horizontal lines.
    pub marks: Vec<Mark>,
}

const LEFT: f64 = 66.0;
const TOP: f64 = 24.0;
const HEIGHT: f64 = 200.0;
const BOTTOM: f64 = 38.0;
/// Width of the density beside a trace.
const SIDE: f64 = 64.0;
const GAP: f64 = 8.0;

/// Draws one panel per coordinate: the trace, and beside it the density of the draws after the burn-in.
pub fn traces(rows: &[Trace], last_step: usize, description: &str) -> Vec<Drawing> {
    rows.iter().map(|row| one(row, last_step, description)).collect()
}

fn one(row: &Trace, last_step: usize, description: &str) -> Drawing {
    let mut svg = Svg::new(PANEL, HEIGHT);
    let area = Area::new(LEFT, TOP, PANEL - LEFT - SIDE - GAP - 6.0, HEIGHT - TOP - BOTTOM);
    draw(&mut svg, row, area, last_step);
    let values = row.chains.iter().enumerate().flat_map(|(i, chain)| {
        let name = format!("chain {}", row.numbers[i] + 1);
        let each = row.steps.iter().zip(chain);
        each.map(move |(&step, &value)| Datum::point(&row.title, &name, (step as f64, value)))
    });
    let sorted = sorted(&row.kept);
    let [low, middle, high] =
        [0.025, 0.5, 0.975].map(|p| typeset(&significant(quantile(&sorted, p), 3)));
    let stranded = match row.stranded.iter().filter(|stranded| **stranded).count() {
        0 => String::new(),
        n => format!("; stranded chains: {n}"),
    };
    let words = format!(
        "{description}, {}: after {} steps of burn-in the median is {middle}, 95 % of the draws lie from {low} to \
         {high}{stranded}",
        row.label, row.burn_in
    );
    Drawing::panel(svg.finish(&words), ["step", &row.label], values.collect())
}

/// Range of the vertical axis: the draws after the burn-in with a wide margin, but no farther than any draw. The
/// approach stays visible, and chains that start far away do not flatten the rest.
fn reach(row: &Trace) -> (f64, f64) {
    let all = extent(row.chains.iter().flatten().copied());
    let Some(all) = all.or_else(|| extent(row.kept.iter().copied())) else { return (0.0, 1.0) };
    let (low, high) = padded(extent(row.kept.iter().copied()).unwrap_or(all), 0.7);
    padded((low.max(all.0), high.min(all.1)), 0.04)
}

fn draw(svg: &mut Svg, row: &Trace, area: Area, last_step: usize) {
    let x = Axis::new("step", (0.0, last_step.max(1) as f64)).ticks(4);
    let y = Axis::new(row.label.as_str(), reach(row)).ticks(5);
    let frame = Frame::new(area, &x, &y);
    svg.text("panel-title", (1.0, 14.0), Anchor::Start, &shortened(&row.title, 46));
    frame.axes(svg, &x, &y);
    frame.inside(svg, &x, &y, |svg| {
        for (class, is_stranded) in [("s-walker", false), ("s-stranded", true)] {
            for (i, chain) in row.chains.iter().enumerate() {
                if row.stranded[i] == is_stranded {
                    let name = format!("chain {}", row.numbers[i] + 1);
                    svg.path(class, &path(&frame, &row.steps, chain), &name);
                }
            }
        }
        let start = frame.x.place(row.burn_in as f64);
        svg.rectangle("burn-in", Area::new(area.x, area.y, start - area.x, area.height), "");
        svg.line("burn-in-end", (start, area.y), (start, area.bottom()));
    });
    draw_density(svg, row, &y, Area::new(area.right() + GAP, area.y, SIDE, area.height));
}

fn path(frame: &Frame, steps: &[usize], chain: &[f64]) -> Path {
    Path::through(steps.iter().zip(chain).map(|(&step, &value)| frame.at((step as f64, value))))
}

fn draw_density(svg: &mut Svg, row: &Trace, y: &Axis, area: Area) {
    let curve = smooth_density(&row.kept, row.effective, 256);
    let highest = curve.iter().map(|p| p.1).fold(0.0, f64::max);
    let x = Axis::new("density", (0.0, 1.08 * highest)).ticks(0);
    let frame = Frame::new(area, &x, y);
    frame.axes(svg, &Axis { numbers: false, ..x.clone() }, &y.shown(false));
    let outline: Vec<_> = curve.iter().map(|&(value, d)| frame.at((d, value))).collect();
    let axis: Vec<_> = curve.iter().map(|&(value, _)| frame.at((0.0, value))).collect();
    svg.clipped(area, |svg| {
        svg.path("s-density-area", &Path::band(&outline, &axis), "");
        svg.path("line s-density", &Path::through(outline), "");
        for mark in row.marks.iter().filter(|m| m.value.is_finite()) {
            let place = frame.y.place(mark.value);
            svg.line(&format!("line {}", mark.class), (area.x, place), (area.right(), place));
        }
    });
}
