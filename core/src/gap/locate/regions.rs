//! The places that are wrong beyond doubt, with their windows: family-wise error by stepping down.

use super::null::{Nulls, Statistics};
use super::scan::{Cell, Scan};
use crate::gap::experiment::Experiment;

/// A part of the response where data and model disagree.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Its cell.
    pub cell: Cell,
    /// The curves.
    pub curves: Vec<usize>,
    /// The first and the last point along the last axis.
    pub span: (f64, f64),
    /// The probability of a false alarm anywhere, at this step.
    pub p: f64,
}

/// The curves with a significant cell, largest first: at each step the largest statistic is judged by the null of the
/// largest among those that are left (Romano and Wolf, Journal of the American Statistical Association 100
/// (2005) 94). The window is that with the most energy for its length, whatever band gave the alarm; curves together are
/// named where none of them is alone.
pub fn regions(
    experiment: &Experiment<'_>,
    scan: &Scan,
    statistics: &Statistics,
    nulls: &Nulls,
    level: f64,
) -> Vec<Region> {
    let cells = &statistics.cells;
    let mut order: Vec<usize> =
        (0..cells.len()).filter(|&p| cells[p].statistic.is_finite()).collect();
    order.sort_by(|&a, &b| cells[b].statistic.total_cmp(&cells[a].statistic));
    let mut found: Vec<Region> = Vec::new();
    let mut p: f64 = 0.0;
    for (step, &place) in order.iter().enumerate() {
        let rest = &order[step..];
        let largest =
            |null: &Vec<f64>| rest.iter().map(|&q| null[q]).fold(f64::NEG_INFINITY, f64::max);
        let null: Vec<f64> = nulls.cells.iter().map(largest).collect();
        p = p.max(super::probability(&null, cells[place].statistic));
        if p > level {
            break;
        }
        let window = scan.window(&statistics.left, place);
        let cell = Cell { window, ..cells[place].clone() };
        let curves = scan.places[place].clone();
        let at = &experiment.curves[curves[0]].at;
        found.push(Region { span: (at[cell.window.0], at[cell.window.1]), curves, cell, p });
    }
    let alone: Vec<usize> =
        found.iter().filter(|r| r.curves.len() == 1).map(|r| r.curves[0]).collect();
    found.retain(|r| r.curves.len() == 1 || !r.curves.iter().any(|s| alone.contains(s)));
    found
}
