//! Steps from one measured value of a series to the next, collected over all replicates.

use std::collections::BTreeMap;

use lacuna::data::Measurements;

use crate::discrepancies::common::{Replicates, Series};

/// A value and the one measured before it, with the statistics of the replicates that measured both in succession.
#[derive(Debug, Clone)]
pub(super) struct Step {
    /// Index of the value among the measured outputs.
    pub at: usize,
    /// Index of the value before; `None` for a first value.
    pub before: Option<usize>,
    /// Distance between the two along the axis.
    pub gap: f64,
    /// Number of replicates.
    pub count: f64,
    /// Means over the replicates: of the value and of the one before.
    pub mean: [f64; 2],
    /// Sums of products of the deviations from the means: of the value, of both, of the one before.
    pub scatter: [f64; 3],
}

/// Indices of a value and the one before it among the measured outputs.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    at: usize,
    before: Option<usize>,
}

/// Values of the replicates that measured both: of the output and of the one before.
struct Pairs {
    gap: f64,
    values: Vec<[f64; 2]>,
}

/// Returns the steps of all series, in a fixed order.
pub(super) fn steps(data: &Measurements, replicates: &Replicates, series: &Series) -> Vec<Step> {
    let mut found: BTreeMap<Key, Pairs> = BTreeMap::new();
    let place = places(data.layout.len(), replicates);
    for_each_step(data, series, |_, (at, y), before, gap| {
        let key = Key { at: place[at], before: before.map(|(i, _)| place[i]) };
        let pairs = found.entry(key).or_insert_with(|| Pairs { gap, values: Vec::new() });
        pairs.values.push([y, before.map_or(0.0, |(_, y)| y)]);
    });
    let step = |(Key { at, before }, Pairs { gap, values: pairs }): (Key, Pairs)| {
        let count = pairs.len() as f64;
        let mean = [0, 1].map(|k| pairs.iter().map(|p| p[k]).sum::<f64>() / count);
        let sum = |a: usize, b: usize| {
            pairs.iter().map(|p| (p[a] - mean[a]) * (p[b] - mean[b])).sum::<f64>()
        };
        let scatter = [sum(0, 0), sum(0, 1), sum(1, 1)];
        Step { at, before, gap, count, mean, scatter }
    };
    found.into_iter().map(step).collect()
}

/// Returns the index of each output among the measured ones; `usize::MAX` for outputs never measured.
pub(super) fn places(outputs: usize, replicates: &Replicates) -> Vec<usize> {
    let mut place = vec![usize::MAX; outputs];
    replicates.measured.iter().enumerate().for_each(|(k, &i)| place[i] = k);
    place
}

/// Visits each measured value of each series together with the one before it. The arguments are the replicate, the
/// output and its value, the output and value before, and their distance.
pub(super) fn for_each_step(
    data: &Measurements,
    series: &Series,
    mut visit: impl FnMut(usize, (usize, f64), Option<(usize, f64)>, f64),
) {
    for (r, replicate) in data.replicates.iter().enumerate() {
        for outputs in &series.outputs {
            let mut before: Option<(usize, f64, f64)> = None;
            for (&i, &t) in outputs.iter().zip(&series.grid) {
                let Some(y) = replicate.values[i] else { continue };
                let gap = before.map_or(f64::INFINITY, |(_, _, last)| t - last);
                visit(r, (i, y), before.map(|(i, y, _)| (i, y)), gap);
                before = Some((i, y, t));
            }
        }
    }
}
