//! Traces of many chains, with the marginal density beside them on the same vertical axis.

use super::{Axis, Frame, Mark, WIDTH};
use crate::page::curve::smooth_density;
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
const ROW: f64 = 176.0;
const BOTTOM: f64 = 38.0;
const SIDE: f64 = 150.0;
const GAP: f64 = 12.0;

/// Number of rows in one drawing; further rows start a new drawing, so that each fits on a sheet of paper.
const SHEET_ROWS: usize = 5;

/// Draws one row per coordinate: the trace, and the density of the draws after the burn-in.
pub fn traces(rows: &[Trace], last_step: usize, description: &str) -> Vec<String> {
    rows.chunks(SHEET_ROWS).map(|rows| sheet(rows, last_step, description)).collect()
}

fn sheet(rows: &[Trace], last_step: usize, description: &str) -> String {
    let mut svg = Svg::new(WIDTH, rows.len() as f64 * ROW + BOTTOM - 8.0);
    for (i, row) in rows.iter().enumerate() {
        let top = i as f64 * ROW + TOP;
        let width = WIDTH - LEFT - SIDE - GAP - 10.0;
        let area = Area::new(LEFT, top, width, ROW - TOP - 14.0);
        draw(&mut svg, row, area, last_step, i + 1 == rows.len());
    }
    svg.finish(description)
}

/// Range of the vertical axis: the draws after the burn-in with a wide margin, but no farther than any draw. The
/// approach stays visible, and chains that start far away do not flatten the rest.
fn reach(row: &Trace) -> (f64, f64) {
    let all = extent(row.chains.iter().flatten().copied());
    let Some(all) = all.or_else(|| extent(row.kept.iter().copied())) else { return (0.0, 1.0) };
    let (low, high) = padded(extent(row.kept.iter().copied()).unwrap_or(all), 0.7);
    padded((low.max(all.0), high.min(all.1)), 0.04)
}

fn draw(svg: &mut Svg, row: &Trace, area: Area, last_step: usize, last_row: bool) {
    let x = Axis::new("step", (0.0, last_step.max(1) as f64)).ticks(7);
    let y = Axis::new(row.label.as_str(), reach(row)).ticks(5);
    let frame = Frame::new(area, &x, &y);
    svg.text("panel-title", (area.x, area.y - 8.0), Anchor::Start, &row.title);
    frame.axes(svg, &x.shown(last_row), &y);
    frame.inside(svg, &x, &y, |svg| {
        for (chain, _) in row.chains.iter().zip(&row.stranded).filter(|(_, stranded)| !**stranded) {
            svg.path("s-walker", &path(&frame, &row.steps, chain), "");
        }
        for (chain, _) in row.chains.iter().zip(&row.stranded).filter(|(_, stranded)| **stranded) {
            svg.path("s-stranded", &path(&frame, &row.steps, chain), "");
        }
        let start = frame.x.place(row.burn_in as f64);
        svg.rectangle("burn-in", Area::new(area.x, area.y, start - area.x, area.height), "");
        svg.line("burn-in-end", (start, area.y), (start, area.bottom()));
    });
    if row.burn_in > 0 {
        let middle = 0.5 * (area.x + frame.x.place(row.burn_in as f64));
        svg.text("halo", (middle, area.bottom() - 6.0), Anchor::Middle, "burn-in, left out");
    }
    draw_density(svg, row, &y, Area::new(area.right() + GAP, area.y, SIDE, area.height), last_row);
}

fn path(frame: &Frame, steps: &[usize], chain: &[f64]) -> Path {
    Path::through(steps.iter().zip(chain).map(|(&step, &value)| frame.at((step as f64, value))))
}

fn draw_density(svg: &mut Svg, row: &Trace, y: &Axis, area: Area, last_row: bool) {
    let curve = smooth_density(&row.kept, row.effective, 256);
    let highest = curve.iter().map(|p| p.1).fold(0.0, f64::max);
    let x = Axis::new("density", (0.0, 1.08 * highest)).ticks(0);
    let frame = Frame::new(area, &x, y);
    frame.axes(svg, &Axis { numbers: false, ..x.shown(last_row) }, &y.shown(false));
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
