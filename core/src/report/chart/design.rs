//! The design as a matrix of scatter plots, with the box where the prior looks.

use super::scatter::dots;
use super::{Axis, Frame, WIDTH};
use crate::report::curve::Histogram;
use crate::report::scale::{extent, padded};
use crate::report::svg::{Anchor, Area, Svg};

/// One parameter, in the shown unit.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignColumn {
    /// The name with its unit.
    pub label: String,
    /// The values, one a run.
    pub values: Vec<f64>,
    /// The interval in which nearly all of the prior lies.
    pub prior: Option<(f64, f64)>,
    /// Whether the design is even in the logarithm.
    pub logarithmic: bool,
}

/// The classes of runs, each with the indices of its runs.
pub type DesignPoints = Vec<(&'static str, Vec<usize>)>;

/// The largest number of parameters that a page has room for.
const MOST: usize = 6;

/// Scatter plots of every pair below the diagonal, histograms on it.
pub fn design_matrix(
    columns: &[DesignColumn],
    classes: &DesignPoints,
    description: &str,
) -> String {
    let n = columns.len().min(MOST);
    let grid = Grid::new(n);
    let mut svg = Svg::new(WIDTH, grid.height());
    let axes: Vec<Axis> = columns.iter().map(axis).collect();
    for row in 0..n {
        for column in 0..=row {
            let area = grid.cell(row, column);
            let x = axes[column].shown(row + 1 == n);
            if row == column {
                draw_diagonal(&mut svg, area, &columns[row], &axes[row], &x);
                continue;
            }
            let frame = Frame::new(area, &axes[column], &axes[row]);
            frame.axes(&mut svg, &x, &axes[row].shown(column == 0));
            draw_pair(&mut svg, &frame, (&columns[column], &columns[row]), classes);
        }
    }
    svg.finish(description)
}

fn axis(column: &DesignColumn) -> Axis {
    let values = column.values.iter().copied();
    let prior = column.prior.iter().flat_map(|&(low, high)| [low, high]);
    let domain = extent(values.chain(prior)).unwrap_or((0.0, 1.0));
    let logarithmic = column.logarithmic && domain.0 > 0.0;
    let domain = if logarithmic {
        let (low, high) = padded((domain.0.ln(), domain.1.ln()), 0.05);
        (low.exp(), high.exp())
    } else {
        padded(domain, 0.05)
    };
    Axis { logarithmic, ..Axis::new(column.label.as_str(), domain).ticks(4) }
}

fn draw_pair(
    svg: &mut Svg,
    frame: &Frame,
    (x, y): (&DesignColumn, &DesignColumn),
    classes: &DesignPoints,
) {
    svg.clipped(frame.area, |svg| {
        for (class, runs) in classes {
            let points: Vec<_> = runs.iter().map(|&i| (x.values[i], y.values[i])).collect();
            svg.path(class, &dots(frame, &points), "");
        }
        if let (Some(x), Some(y)) = (x.prior, y.prior) {
            let (left, top) = frame.at((x.0, y.1));
            let (right, bottom) = frame.at((x.1, y.0));
            svg.rectangle("s-box", Area::new(left, top, right - left, bottom - top), "");
        }
    });
}

fn draw_diagonal(svg: &mut Svg, area: Area, column: &DesignColumn, domain: &Axis, shown: &Axis) {
    let logarithmic = domain.logarithmic;
    let forward = |v: f64| if logarithmic { v.ln() } else { v };
    let back = |v: f64| if logarithmic { v.exp() } else { v };
    let values: Vec<f64> = column.values.iter().map(|&v| forward(v)).collect();
    let histogram = Histogram::of(&values, 24);
    let highest = histogram.iter().flat_map(|h| h.density.iter().copied()).fold(0.0, f64::max);
    let y = Axis::new("", (0.0, 1.2 * highest)).ticks(0);
    let frame = Frame::new(area, domain, &y);
    frame.axes(svg, shown, &y);
    for (left, right, density) in histogram.iter().flat_map(Histogram::bins) {
        let (x0, y0) = frame.at((back(left), density));
        let (x1, y1) = frame.at((back(right), 0.0));
        svg.rectangle("s-design-bar", Area::new(x0, y0, x1 - x0, y1 - y0), "");
    }
    if let Some((low, high)) = column.prior {
        let (left, right) = (frame.x.place(low), frame.x.place(high));
        svg.rectangle("s-box", Area::new(left, area.y, right - left, area.height), "");
    }
    svg.text("panel-title", (area.x, area.y - 5.0), Anchor::Start, &column.label);
}

/// Square cells of a lower triangle.
pub struct Grid {
    n: usize,
    side: f64,
    left: f64,
}

impl Grid {
    const GAP: f64 = 24.0;

    /// The cells for `n` columns.
    pub fn new(n: usize) -> Self {
        let most = if n <= 3 { 210.0 } else { 180.0 };
        let n_float = n.max(1) as f64;
        let side = ((WIDTH - 80.0 - Self::GAP * (n_float - 1.0)) / n_float).min(most);
        let width = side * n_float + Self::GAP * (n_float - 1.0);
        Self { n, side, left: ((WIDTH - width) / 2.0).max(68.0) }
    }

    /// The height of the whole drawing.
    pub fn height(&self) -> f64 {
        20.0 + (self.side + Self::GAP) * self.n.max(1) as f64 + 26.0
    }

    /// The cell in this row and column.
    pub fn cell(&self, row: usize, column: usize) -> Area {
        let step = self.side + Self::GAP;
        let (x, y) = (self.left + step * column as f64, 18.0 + step * row as f64);
        Area::new(x, y, self.side, self.side)
    }
}
