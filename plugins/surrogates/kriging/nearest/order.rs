//! Order of the runs, and the runs on which each is conditioned.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::tree::{Tree, Wanted};

/// Runs in an order in which each is far from those before it, and for each its nearest predecessors.
///
/// Such an order makes the predecessors a coarse design around each run at first and a fine one later, for which
/// conditioning on the nearest alone loses least (Guinness, Technometrics 60 (2018) 415).
#[derive(Debug, Clone, PartialEq)]
pub struct Neighbours {
    /// The blocks one after the other: the neighbours of a run, the nearest first, then the run itself.
    runs: Vec<u32>,
    /// End of each block.
    ends: Vec<usize>,
}

impl Neighbours {
    /// Orders runs (one per column, in length scales), each with at most `count` neighbours.
    pub fn of(points: &Matrix, count: usize) -> Self {
        Self::of_some(points, count, points.columns())
    }

    /// Like [`Self::of`], with the blocks of at most `most` runs, evenly spaced in the order: the neighbours are still
    /// chosen among all runs.
    pub fn of_some(points: &Matrix, count: usize, most: usize) -> Self {
        let order = maximin(points);
        let tree = Tree::new(points, &order);
        let block = |k: usize| {
            let wanted = Wanted { count, below: k as u32, except: None };
            let mut ranks = tree.nearest(&points.column(order[k]), wanted);
            ranks.push(k as u32);
            ranks
        };
        let kept = most.min(order.len());
        let place = |j: usize| j * order.len() / kept;
        let blocks: Vec<Vec<u32>> = (0..kept).into_par_iter().map(|j| block(place(j))).collect();
        let (mut runs, mut ends) = (Vec::new(), Vec::with_capacity(kept));
        for block in &blocks {
            runs.extend(block.iter().map(|&rank| order[rank as usize] as u32));
            ends.push(runs.len());
        }
        Self { runs, ends }
    }

    /// Returns the number of blocks.
    pub fn count(&self) -> usize {
        self.ends.len()
    }

    /// Returns the range of block `k` among the entries of all blocks.
    pub fn range(&self, k: usize) -> std::ops::Range<usize> {
        let first = if k == 0 { 0 } else { self.ends[k - 1] };
        first..self.ends[k]
    }

    /// Returns block `k`: the neighbours of a run, then the run itself.
    pub fn block(&self, k: usize) -> &[u32] {
        &self.runs[self.range(k)]
    }
}

/// A run that waits for its place in the order, with its squared distance from the runs that have one.
#[derive(PartialEq)]
struct Waiting(f64, usize);

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    /// The farthest comes first; among equals the first run.
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(other.1.cmp(&self.1))
    }
}

/// Returns the order that begins near the mean and goes on with the run whose distance from the runs so far is
/// largest.
pub fn maximin(points: &Matrix) -> Vec<usize> {
    let (d, n) = (points.rows(), points.columns());
    let square = |i: usize, place: &[f64]| -> f64 {
        (0..d).map(|k| (points[(k, i)] - place[k]) * (points[(k, i)] - place[k])).sum()
    };
    let mean: Vec<f64> =
        (0..d).map(|k| points.row(k).iter().sum::<f64>() / n.max(1) as f64).collect();
    let central = (0..n).min_by(|&a, &b| square(a, &mean).total_cmp(&square(b, &mean)));
    let Some(central) = central else { return Vec::new() };
    let tree = Tree::new(points, &(0..n).collect::<Vec<_>>());
    let start = points.column(central);
    let mut distances: Vec<f64> = (0..n).map(|i| square(i, &start)).collect();
    let mut order = vec![central];
    let mut waiting: BinaryHeap<Waiting> =
        (0..n).filter(|&i| i != central).map(|i| Waiting(distances[i], i)).collect();
    while let Some(Waiting(distance, run)) = waiting.pop() {
        // Distances only shrink, and are corrected when a run comes to the top.
        if distances[run] < distance {
            waiting.push(Waiting(distances[run], run));
            continue;
        }
        order.push(run);
        tree.within(&points.column(run), distance, &mut |other, square| {
            let old = &mut distances[other as usize];
            *old = old.min(square);
        });
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surrogates::gaussian_process::tests::recurrence;

    #[test]
    fn the_order_is_that_of_a_search_among_all() {
        let mut points = recurrence(0, 200, 2).transposed();
        for i in 180..200 {
            (0..2).for_each(|k| points[(k, i)] = points[(k, i - 180)]);
        }
        let order = maximin(&points);
        let square = |a: usize, b: usize| -> f64 {
            (0..2).map(|k| (points[(k, a)] - points[(k, b)]).powi(2)).sum()
        };
        let from = |run: usize, before: &[usize]| {
            before.iter().map(|&b| square(run, b)).fold(f64::INFINITY, f64::min)
        };
        for k in 1..200 {
            let (before, rest) = order.split_at(k);
            let farthest = rest.iter().map(|&run| from(run, before)).fold(0.0, f64::max);
            assert_eq!(from(rest[0], before), farthest);
        }
        let neighbours = Neighbours::of(&points, 7);
        assert_eq!(neighbours.count(), 200);
        for k in 0..200 {
            let block: Vec<usize> = neighbours.block(k).iter().map(|&i| i as usize).collect();
            assert_eq!((block.len(), block.last()), (k.min(7) + 1, Some(&order[k])));
            assert!(block[..k.min(7)].iter().all(|run| order[..k].contains(run)));
        }
    }
}
