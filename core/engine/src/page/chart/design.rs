//! The design as a matrix of scatter plots, with the central interval of the prior.

use super::scatter::dots;
use super::triangle::{Cell, triangle};
use super::{Axis, Frame};
use crate::page::curve::Histogram;
use crate::page::drawing::{Datum, Drawing};
use crate::page::scale::{extent, padded};
use crate::page::svg::{Anchor, Area, Svg};

/// Values of one parameter, in the displayed unit.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignColumn {
    /// Name of the parameter with its unit.
    pub label: String,
    /// Values, one per run.
    pub values: Vec<f64>,
    /// Interval that contains nearly all of the prior's probability.
    pub prior: Option<(f64, f64)>,
    /// True if the design is uniform in the logarithm.
    pub logarithmic: bool,
}

/// CSS classes of runs, each with the indices of its runs.
pub type DesignPoints = Vec<(&'static str, Vec<usize>)>;

/// Largest number of parameters that fit on a page.
pub const MOST_CROSSED: usize = 6;

/// Draws scatter plots of all pairs below the diagonal and histograms on it.
pub fn design_matrix(
    columns: &[DesignColumn],
    classes: &DesignPoints,
    description: &str,
) -> Drawing {
    let n = columns.len().min(MOST_CROSSED);
    let axes: Vec<Axis> = columns[..n].iter().map(axis).collect();
    let listed = |column: &DesignColumn| {
        let each = column.values.iter().enumerate();
        let run = |(i, value): (usize, &f64)| {
            Datum::point(&column.label, "run", (i as f64 + 1.0, *value))
        };
        each.map(run).collect::<Vec<_>>()
    };
    let values = columns[..n].iter().flat_map(listed).collect();
    let svg = triangle(&axes, description, |svg, cell| match cell {
        Cell::Diagonal { index, area, shown } => {
            draw_diagonal(svg, area, &columns[index], &axes[index], &shown);
        }
        Cell::Pair { x, y, frame } => frame.inside(svg, &axes[x], &axes[y], |svg| {
            draw_pair(svg, &frame, (&columns[x], &columns[y]), classes);
        }),
    });
    Drawing::scrolled(svg, ["number of the run", "value"], values)
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
    for (class, runs) in classes {
        let points: Vec<_> = runs.iter().map(|&i| (x.values[i], y.values[i])).collect();
        svg.path(class, &dots(frame, &points), if *class == "s-run" { "run" } else { "" });
    }
    if let (Some(x), Some(y)) = (x.prior, y.prior) {
        let (left, top) = frame.at((x.0, y.1));
        let (right, bottom) = frame.at((x.1, y.0));
        svg.rectangle("s-box", Area::new(left, top, right - left, bottom - top), "");
    }
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
