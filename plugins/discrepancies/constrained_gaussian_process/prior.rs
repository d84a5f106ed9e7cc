//! Prior of the bias of each series, given what is known about it.
//!
//! With `C` the joint covariance of the values at the outputs and of the functionals that are not negative, `X` their
//! covariance with the functionals whose values `t` are known, and `S` the covariance of these,
//!
//! ```text
//! mean = B t,  covariance = C - B X',  B = X S^-1,
//! d mean = (dX - B dS) S^-1 t,  d covariance = dC - dX B' - B dX' + B dS B'.
//! ```

use lacuna_linalg::{Cholesky, Matrix, multiply, multiply_transposed, multiply_vector};

use super::knowledge::Knowledge;
use crate::discrepancies::common::{Block, Correlation, Functional, PerGroup};

/// Standard deviation of the error in the conditions on sign and direction, per prior standard deviation.
const SOFTNESS: f64 = 1e-3;

/// Prior of the bias of all series.
#[derive(Debug, Clone)]
pub(super) struct Prior {
    pub kernel: Correlation,
    pub blocks: Vec<Block>,
    /// Values of the axis of a complete series.
    pub grid: Vec<f64>,
    pub knowledge: Knowledge,
    pub sd: PerGroup,
    pub length: PerGroup,
}

/// Joint normal distribution of the bias at places and of the functionals that are not negative, in this order, before
/// these conditions; with derivatives with respect to the correlation length.
#[derive(Debug, Clone)]
pub(super) struct Joint {
    pub mean: Vec<f64>,
    pub covariance: Matrix,
    pub mean_by_length: Vec<f64>,
    pub covariance_by_length: Matrix,
}

impl Prior {
    /// Returns the standard deviation and the correlation length of each group; `None` if one is not above zero.
    pub fn values<'a>(&'a self, hyper: &'a [f64]) -> Option<(&'a [f64], &'a [f64])> {
        Some((self.sd.values(hyper)?, self.length.values(hyper)?))
    }

    /// Returns the number of functionals of each series that are not negative.
    pub fn conditions(&self) -> usize {
        self.knowledge.positive.len()
    }

    /// Returns the prior of each series at its measured outputs; `None` in place of one that has an earlier twin.
    pub fn measured(&self, values: (&[f64], &[f64])) -> Option<Vec<Option<Joint>>> {
        let one = |block: &Block| {
            if block.twin.is_some() {
                return Some(None);
            }
            Some(Some(self.joint(&block.grid, block.of(values))?))
        };
        self.blocks.iter().map(one).collect()
    }

    /// Returns the prior that belongs to a series.
    pub fn of<'a>(&self, all: &'a [Option<Joint>], series: usize) -> Option<&'a Joint> {
        all[self.blocks[series].twin.unwrap_or(series)].as_ref()
    }

    /// Returns the prior at these values of the axis; `None` if the known functionals are not independent.
    pub fn joint(&self, grid: &[f64], (sd, length): (f64, f64)) -> Option<Joint> {
        let values = grid.iter().map(|&at| Functional::value(at));
        let free: Vec<Functional> = values.chain(self.knowledge.positive.iter().copied()).collect();
        let fixed: Vec<Functional> = self.knowledge.fixed.iter().map(|(f, _)| *f).collect();
        let [mut covariance, mut by_length] = self.covariances(&free, &free, length);
        for k in grid.len()..free.len() {
            let (own, slope) = self.kernel.covariance(&free[k], &free[k], length);
            covariance[(k, k)] += SOFTNESS * SOFTNESS * own;
            by_length[(k, k)] += SOFTNESS * SOFTNESS * slope;
        }
        let (mut mean, mut mean_by_length) = (vec![0.0; free.len()], vec![0.0; free.len()]);
        if !fixed.is_empty() {
            let known: Vec<f64> = self.knowledge.fixed.iter().map(|(_, value)| *value).collect();
            let [cross, cross_slope] = self.covariances(&free, &fixed, length);
            let [inner, inner_slope] = self.covariances(&fixed, &fixed, length);
            let inner = Cholesky::new(&inner).ok()?;
            let weights = inner.solve_matrix(&cross.transposed()).transposed();
            let of_inner = multiply(&weights, &inner_slope);
            let taken = multiply_transposed(&weights, &cross);
            let moved = multiply_transposed(&cross_slope, &weights);
            let kept = multiply_transposed(&of_inner, &weights);
            for i in 0..free.len() {
                for j in 0..free.len() {
                    covariance[(i, j)] -= taken[(i, j)];
                    by_length[(i, j)] += kept[(i, j)] - moved[(i, j)] - moved[(j, i)];
                }
            }
            mean = multiply_vector(&weights, &known);
            let mut solved = known;
            inner.solve(&mut solved);
            let change = Matrix::from_fn(free.len(), fixed.len(), |i, j| {
                cross_slope[(i, j)] - of_inner[(i, j)]
            });
            mean_by_length = multiply_vector(&change, &solved);
        }
        let square = sd * sd;
        covariance.as_mut_slice().iter_mut().for_each(|c| *c *= square);
        by_length.as_mut_slice().iter_mut().for_each(|c| *c *= square);
        Some(Joint { mean, covariance, mean_by_length, covariance_by_length: by_length })
    }

    /// Returns the covariances of functionals of a process of unit variance, and their derivatives with respect to the
    /// length.
    fn covariances(&self, rows: &[Functional], columns: &[Functional], length: f64) -> [Matrix; 2] {
        let (n, m) = (rows.len(), columns.len());
        let (mut value, mut slope) = (Matrix::zeros(n, m), Matrix::zeros(n, m));
        for (i, a) in rows.iter().enumerate() {
            for (j, b) in columns.iter().enumerate() {
                (value[(i, j)], slope[(i, j)]) = self.kernel.covariance(a, b, length);
            }
        }
        [value, slope]
    }
}

impl Joint {
    /// Returns mean and covariance of the functionals that are not negative; `places` is the number of values before
    /// them.
    pub fn conditions(&self, places: usize) -> (&[f64], Matrix) {
        let m = self.mean.len() - places;
        let own = Matrix::from_fn(m, m, |i, j| self.covariance[(places + i, places + j)]);
        (&self.mean[places..], own)
    }
}
