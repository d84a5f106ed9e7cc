//! Draws of a sampler.

use serde::{Deserialize, Serialize};

use crate::matrix::Matrix;

/// The draws of all chains of one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Draws {
    /// Names of the coordinates.
    pub names: Vec<String>,
    /// Number of chains (walkers).
    pub chains: usize,
    /// Number of steps kept from each chain.
    pub steps: usize,
    /// Coordinates of the draws, row-major as `chains x steps x dimension`.
    pub values: Vec<f64>,
    /// Log density of each draw, row-major as `chains x steps`.
    pub log_density: Vec<f64>,
}

impl Draws {
    /// Collects draws from the steps of a run; each step holds its points (`chains x dimension`) and their log
    /// densities (one per chain).
    ///
    /// # Panics
    /// If the number of chains or coordinates differs between steps.
    pub fn from_steps(names: Vec<String>, steps: &[(Matrix, Vec<f64>)]) -> Self {
        let chains = steps.first().map_or(0, |(points, _)| points.rows());
        let mut draws = Self {
            chains,
            steps: steps.len(),
            values: Vec::with_capacity(chains * steps.len() * names.len()),
            log_density: Vec::with_capacity(chains * steps.len()),
            names,
        };
        for chain in 0..chains {
            for (points, log_density) in steps {
                assert_eq!((points.rows(), points.columns()), (chains, draws.names.len()));
                draws.values.extend_from_slice(points.row(chain));
                draws.log_density.push(log_density[chain]);
            }
        }
        draws
    }

    /// Number of coordinates.
    pub fn dimension(&self) -> usize {
        self.names.len()
    }

    /// Total number of draws, `chains x steps`.
    pub fn len(&self) -> usize {
        self.chains * self.steps
    }

    /// Returns true if there are no draws.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The point of one chain at one step, one value per coordinate.
    pub fn point(&self, chain: usize, step: usize) -> &[f64] {
        let from = (chain * self.steps + step) * self.dimension();
        &self.values[from..from + self.dimension()]
    }

    /// Log density along one chain, one value per step.
    pub fn log_density_of(&self, chain: usize) -> &[f64] {
        &self.log_density[chain * self.steps..(chain + 1) * self.steps]
    }

    /// The values of coordinate `j`, one vector per chain.
    pub fn coordinate(&self, j: usize) -> impl ExactSizeIterator<Item = Vec<f64>> {
        (0..self.chains)
            .map(move |chain| (0..self.steps).map(|step| self.point(chain, step)[j]).collect())
    }

    /// The values of coordinate `j`, all chains concatenated.
    pub fn pooled(&self, j: usize) -> Vec<f64> {
        self.values.iter().skip(j).step_by(self.dimension().max(1)).copied().collect()
    }

    /// All points as a matrix, `chains * steps x dimension`, chain by chain.
    pub fn points(&self) -> Matrix {
        Matrix::from_vec(self.len(), self.dimension(), self.values.clone())
    }

    /// The draws without the first `fraction` of each chain (rounded down to whole steps).
    #[must_use]
    pub fn after_burn_in(&self, fraction: f64) -> Self {
        let first = (self.steps as f64 * fraction.clamp(0.0, 1.0)).floor() as usize;
        self.keep(&(0..self.chains).collect::<Vec<_>>(), first)
    }

    /// The draws of the given chains, in the given order.
    #[must_use]
    pub fn of_chains(&self, chains: &[usize]) -> Self {
        self.keep(chains, 0)
    }

    /// The draws without the first `first` steps of each chain.
    #[must_use]
    pub fn from_step(&self, first: usize) -> Self {
        self.keep(&(0..self.chains).collect::<Vec<_>>(), first.min(self.steps))
    }

    fn keep(&self, chains: &[usize], first: usize) -> Self {
        let mut kept = Self {
            names: self.names.clone(),
            chains: chains.len(),
            steps: self.steps - first,
            values: Vec::new(),
            log_density: Vec::new(),
        };
        for &chain in chains {
            let (from, to) = (chain * self.steps + first, (chain + 1) * self.steps);
            kept.log_density.extend_from_slice(&self.log_density[from..to]);
            let d = self.dimension();
            kept.values.extend_from_slice(&self.values[from * d..to * d]);
        }
        kept
    }

    /// The chain and the step of the draw with the largest log density; the first one if several are equal. `None`
    /// without draws.
    pub fn best(&self) -> Option<(usize, usize)> {
        let index = (0..self.log_density.len())
            .reduce(|a, b| if self.log_density[b] > self.log_density[a] { b } else { a })?;
        Some((index / self.steps, index % self.steps))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draws() -> Draws {
        let steps: Vec<_> = (0..4)
            .map(|step| {
                let points = Matrix::from_fn(3, 2, |chain, j| (100 * chain + 10 * step + j) as f64);
                (points, (0..3).map(|chain| (10 * chain + step) as f64).collect())
            })
            .collect();
        Draws::from_steps(vec!["a".into(), "b".into()], &steps)
    }

    #[test]
    fn draws_are_kept_chain_by_chain() {
        let draws = draws();
        assert_eq!(draws.point(2, 3), [230.0, 231.0]);
        assert_eq!(draws.log_density_of(1), [10.0, 11.0, 12.0, 13.0]);
        assert_eq!(draws.coordinate(1).nth(1), Some(vec![101.0, 111.0, 121.0, 131.0]));
        assert_eq!(draws.pooled(0)[4..6], [100.0, 110.0]);
        assert_eq!(draws.best(), Some((2, 3)));
    }

    #[test]
    fn the_burn_in_is_dropped_from_each_chain() {
        let kept = draws().after_burn_in(0.5);
        assert_eq!((kept.chains, kept.steps), (3, 2));
        assert_eq!(kept.point(1, 0), [120.0, 121.0]);
        assert_eq!(draws().after_burn_in(1.0).len(), 0);
        assert_eq!(draws().of_chains(&[2]).point(0, 1), [210.0, 211.0]);
    }
}
