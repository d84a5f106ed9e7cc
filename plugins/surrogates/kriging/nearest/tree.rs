//! Tree of points, for searches by distance.

use lacuna_linalg::Matrix;

/// Number of points below which a box is not divided further.
const LEAF: usize = 24;

/// Points in nested boxes (Friedman, Bentley and Finkel, ACM Transactions on Mathematical Software 3 (1977) 209).
///
/// Each point has a rank, so that a search can be limited to points of lower rank.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    dimension: usize,
    /// Ranks of the points, those of a box together.
    ranks: Vec<u32>,
    /// Coordinates of the points in the same order, those of a point together.
    places: Vec<f64>,
    nodes: Vec<Node>,
    /// Lower ends of each box, then its upper ends.
    boxes: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Node {
    first: usize,
    last: usize,
    /// Smallest rank in the box.
    least: u32,
    /// Indices of the two halves; `None` for a box that is not divided.
    halves: Option<[usize; 2]>,
}

/// Points that a search may return.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Number of points.
    pub count: usize,
    /// Ranks below this one.
    pub below: u32,
    /// Rank that is left out.
    pub except: Option<u32>,
}

impl Wanted {
    /// The nearest of all points.
    pub fn all(count: usize) -> Self {
        Self { count, below: u32::MAX, except: None }
    }
}

impl Tree {
    /// Builds the tree of points (one per column); the rank of point `order[k]` is `k`.
    pub fn new(points: &Matrix, order: &[usize]) -> Self {
        let (dimension, count) = (points.rows(), order.len());
        let mut ranks: Vec<u32> = (0..count as u32).collect();
        let mut tree = Self {
            dimension,
            ranks: Vec::new(),
            places: Vec::new(),
            nodes: Vec::new(),
            boxes: Vec::new(),
        };
        let at = |rank: u32, k: usize| points[(k, order[rank as usize])];
        tree.divide(&mut ranks, 0, &at);
        tree.places = ranks.iter().flat_map(|&r| (0..dimension).map(move |k| at(r, k))).collect();
        tree.ranks = ranks;
        tree
    }

    /// Adds the box of some points, the first of which has this index, and the boxes in it.
    fn divide(
        &mut self,
        ranks: &mut [u32],
        first: usize,
        at: &impl Fn(u32, usize) -> f64,
    ) -> usize {
        let node = self.nodes.len();
        let least = ranks.iter().copied().min().unwrap_or(u32::MAX);
        self.nodes.push(Node { first, last: first + ranks.len(), least, halves: None });
        let end = |k: usize, pick: fn(f64, f64) -> f64, from: f64| {
            ranks.iter().fold(from, |end, &rank| pick(end, at(rank, k)))
        };
        let low: Vec<f64> = (0..self.dimension).map(|k| end(k, f64::min, f64::INFINITY)).collect();
        let high: Vec<f64> =
            (0..self.dimension).map(|k| end(k, f64::max, f64::NEG_INFINITY)).collect();
        let width = |k: usize| high[k] - low[k];
        let widest = (0..self.dimension).max_by(|&a, &b| width(a).total_cmp(&width(b)));
        self.boxes.extend(low.iter().chain(&high));
        let Some(widest) = widest.filter(|&k| ranks.len() > LEAF && width(k) > 0.0) else {
            return node;
        };
        let middle = ranks.len() / 2;
        ranks.select_nth_unstable_by(middle, |&a, &b| {
            at(a, widest).total_cmp(&at(b, widest)).then(a.cmp(&b))
        });
        let (left, right) = ranks.split_at_mut(middle);
        let left = self.divide(left, first, at);
        let right = self.divide(right, first + middle, at);
        self.nodes[node].halves = Some([left, right]);
        node
    }

    /// Returns the ranks of the points nearest to a place, the nearest first; of points at equal distance, that of
    /// lower rank. Fewer if there are not as many.
    pub fn nearest(&self, place: &[f64], wanted: Wanted) -> Vec<u32> {
        let mut found = Vec::with_capacity(wanted.count.min(self.ranks.len()) + 1);
        if wanted.count > 0 && !self.nodes.is_empty() {
            self.search(0, self.gap(0, place), place, wanted, &mut found);
        }
        found.into_iter().map(|(_, rank)| rank).collect()
    }

    fn search(
        &self,
        node: usize,
        gap: f64,
        place: &[f64],
        wanted: Wanted,
        found: &mut Vec<(f64, u32)>,
    ) {
        let Node { first, last, least, halves } = self.nodes[node];
        if least >= wanted.below || (found.len() == wanted.count && gap > farthest(found)) {
            return;
        }
        if let Some(halves) = halves {
            let mut gaps = halves.map(|half| (self.gap(half, place), half));
            if gaps[1].0 < gaps[0].0 {
                gaps.swap(0, 1);
            }
            for (gap, half) in gaps {
                self.search(half, gap, place, wanted, found);
            }
            return;
        }
        for i in first..last {
            let rank = self.ranks[i];
            if rank >= wanted.below || Some(rank) == wanted.except {
                continue;
            }
            let entry = (self.square(i, place), rank);
            let full = found.len() == wanted.count;
            if full && entry.0 > farthest(found) {
                continue;
            }
            let order = |a: &(f64, u32)| a.0.total_cmp(&entry.0).then(a.1.cmp(&entry.1)).is_lt();
            found.insert(found.partition_point(order), entry);
            found.truncate(wanted.count);
        }
    }

    /// Calls `give` with the rank and the squared distance of each point nearer to a place than the root of `square`.
    pub fn within(&self, place: &[f64], square: f64, give: &mut impl FnMut(u32, f64)) {
        let mut left = if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(node) = left.pop() {
            if self.gap(node, place) >= square {
                continue;
            }
            if let Some(halves) = self.nodes[node].halves {
                left.extend(halves);
                continue;
            }
            for i in self.nodes[node].first..self.nodes[node].last {
                let distance = self.square(i, place);
                if distance < square {
                    give(self.ranks[i], distance);
                }
            }
        }
    }

    /// Returns the squared distance of a point from a place.
    fn square(&self, i: usize, place: &[f64]) -> f64 {
        let own = &self.places[i * self.dimension..(i + 1) * self.dimension];
        own.iter().zip(place).map(|(a, b)| (a - b) * (a - b)).sum()
    }

    /// Returns the squared distance of a box from a place.
    fn gap(&self, node: usize, place: &[f64]) -> f64 {
        let ends = &self.boxes[2 * node * self.dimension..2 * (node + 1) * self.dimension];
        let (low, high) = ends.split_at(self.dimension);
        let beyond = |((low, high), x): ((&f64, &f64), &f64)| (low - x).max(x - high).max(0.0);
        low.iter().zip(high).zip(place).map(beyond).map(|gap| gap * gap).sum()
    }
}

fn farthest(found: &[(f64, u32)]) -> f64 {
    found.last().map_or(f64::INFINITY, |(square, _)| *square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surrogates::gaussian_process::tests::recurrence;

    /// Compares with a search among all points; a third of the points are duplicates.
    #[test]
    fn the_nearest_are_those_of_a_search_among_all() {
        let mut points = recurrence(0, 300, 3).transposed();
        for i in 200..300 {
            (0..3).for_each(|k| points[(k, i)] = points[(k, i - 200)]);
        }
        let order: Vec<usize> = (0..300).map(|i| (7 * i) % 300).collect();
        let tree = Tree::new(&points, &order);
        for (i, place) in recurrence(300, 40, 3).iter_rows().enumerate() {
            for (count, below, except) in [(5, 300, None), (30, 100, Some(3)), (400, 50, None)] {
                let square = |rank: u32| -> f64 {
                    let column = points.column(order[rank as usize]);
                    column.iter().zip(place).map(|(a, b)| (a - b) * (a - b)).sum()
                };
                let mut all: Vec<u32> = (0..below).filter(|r| Some(*r) != except).collect();
                all.sort_by(|&a, &b| square(a).total_cmp(&square(b)).then(a.cmp(&b)));
                all.truncate(count);
                assert_eq!(tree.nearest(place, Wanted { count, below, except }), all, "{i}");
                let mut near = Vec::new();
                tree.within(place, 0.09, &mut |rank, _| near.push(rank));
                near.sort_unstable();
                let expected: Vec<u32> = (0..300).filter(|&r| square(r) < 0.09).collect();
                assert_eq!(near, expected);
            }
        }
    }
}
