//! The regions in which data and model disagree, with familywise error rate by a step-down procedure.

use super::null::{NullDistribution, TestStatistics};
use super::scan::{Cell, Scan};
use crate::gap::experiment::Experiment;

/// A part of the response where data and model disagree.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The cell with the largest statistic.
    pub cell: Cell,
    /// The curves, by their index in the experiment.
    pub curves: Vec<usize>,
    /// The first and the last point along the last axis, in its unit.
    pub span: (f64, f64),
    /// The familywise p-value at this step of the step-down procedure.
    pub p: f64,
}

/// Finds the curves with a significant cell, largest statistic first: at each step the largest statistic is compared
/// with the null distribution of the largest among those that remain (Romano and Wolf, Journal of the American
/// Statistical Association 100 (2005) 94). The window is the one with the largest statistic over all frequencies,
/// whichever band was significant; several curves together form a region if none of them is significant alone. `level`
/// is the familywise error rate.
pub fn regions(
    experiment: &Experiment<'_>,
    scan: &Scan,
    statistics: &TestStatistics,
    nulls: &NullDistribution,
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
        p = p.max(nulls.probability(&null, cells[place].statistic));
        if p > level {
            break;
        }
        let window = scan.window(&statistics.residual, place);
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
