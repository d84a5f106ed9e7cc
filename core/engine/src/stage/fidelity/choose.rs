//! Choice of the runs to be repeated: those that together are closest to all others.

use lacuna::data::Parameter;
use lacuna_linalg::Matrix;

/// Largest number of candidates; of more, only the first ones are used.
const MOST: usize = 2000;

/// Points in coordinates in which a parameter's design is uniform on 0 to 1.
pub struct Coverage {
    points: Matrix,
}

impl Coverage {
    /// Converts points in physical units, one per row.
    pub fn new(parameters: &[Parameter], points: &Matrix) -> Self {
        let place = |i: usize, j: usize| parameters[j].design.cdf(points[(i, j)]);
        Self { points: Matrix::from_fn(points.rows(), points.columns(), place) }
    }

    /// Squared distance between two points.
    fn square(&self, a: usize, b: usize) -> f64 {
        let pairs = self.points.row(a).iter().zip(self.points.row(b));
        pairs.map(|(x, y)| (x - y).powi(2)).sum()
    }
}

/// Chooses `count` of the candidates one after the other, each the one that most reduces the mean squared distance of
/// all candidates from the nearest chosen one (the sequential form of a design of representative points; the first one
/// is the most central).
///
/// The result does not depend on the order of the candidates, except for ties, which the first one wins; the first `n`
/// of a longer choice are the choice of `n`.
pub fn cover(coverage: &Coverage, candidates: &[usize], count: usize) -> Vec<usize> {
    if count >= candidates.len() {
        return candidates.to_vec();
    }
    let candidates = &candidates[..candidates.len().min(MOST.max(count))];
    let mut nearest = vec![f64::INFINITY; candidates.len()];
    let mut chosen = Vec::with_capacity(count);
    for _ in 0..count {
        let mut best: Option<(f64, usize)> = None;
        for &candidate in candidates.iter().filter(|c| !chosen.contains(*c)) {
            let left = candidates
                .iter()
                .zip(&nearest)
                .map(|(&other, near)| near.min(coverage.square(candidate, other)));
            let left: f64 = left.sum();
            if best.is_none_or(|(least, _)| left < least) {
                best = Some((left, candidate));
            }
        }
        let Some((_, next)) = best else { break };
        chosen.push(next);
        for (near, &other) in nearest.iter_mut().zip(candidates) {
            *near = near.min(coverage.square(next, other));
        }
    }
    chosen
}
