//! Sparse factor of the inverse of a covariance.

use lacuna_linalg::{Cholesky, Matrix, solve_lower_transposed, vector};
use rayon::prelude::*;

use super::super::kernel::Kernel;
use super::order::Neighbours;

/// Number of runs that one task computes.
pub const CHUNK: usize = 64;

/// Covariance of a run and its neighbours: one block of Vecchia's approximation.
pub struct Block {
    /// Neighbours and run in length scales, one per column.
    pub points: Matrix,
    /// `-c'(r) / r` of each pair, below the diagonal.
    pub slopes: Matrix,
    /// Factor `L` of the covariance.
    pub cholesky: Cholesky,
    /// Last row of `L^-1`: its product with the block's scores is the residual of the run given its neighbours, in
    /// units of the conditional standard deviation.
    pub weights: Vec<f64>,
}

impl Block {
    /// Factors the block of some runs; `None` if its covariance is singular.
    pub fn new(kernel: Kernel, points: &Matrix, runs: &[u32], nugget: f64) -> Option<Self> {
        let gathered =
            Matrix::from_fn(points.rows(), runs.len(), |k, j| points[(k, runs[j] as usize)]);
        let (covariance, slopes) = kernel.among(&gathered, nugget);
        let cholesky = Cholesky::new(&covariance).ok()?;
        let mut weights = vec![0.0; runs.len()];
        *weights.last_mut()? = 1.0;
        solve_lower_transposed(cholesky.lower(), &mut weights);
        Some(Self { points: gathered, slopes, cholesky, weights })
    }
}

/// Vecchia's approximation `K^-1 = B' B` with one row of `B` for each run, which has entries for its neighbours and
/// itself alone (Vecchia, Journal of the Royal Statistical Society B 50 (1988) 297; Katzfuss and Guinness, Statistical
/// Science 36 (2021) 124). It is the sparse factor with these entries that is nearest to the exact one
/// (Kullback-Leibler; Schäfer, Katzfuss and Owhadi, SIAM Journal on Scientific Computing 43 (2021) A2019).
pub struct Precision<'a> {
    neighbours: &'a Neighbours,
    /// Entries of all rows one after the other.
    weights: Vec<f64>,
    /// `log |K|`.
    pub log_determinant: f64,
}

impl<'a> Precision<'a> {
    /// Computes the factor for points in length scales (one per column); `None` if a block is singular.
    pub fn new(
        kernel: Kernel,
        points: &Matrix,
        neighbours: &'a Neighbours,
        nugget: f64,
    ) -> Option<Self> {
        let rows = |chunk: usize| -> Option<Vec<f64>> {
            let last = neighbours.count().min((chunk + 1) * CHUNK);
            let mut all = Vec::new();
            for k in chunk * CHUNK..last {
                all.extend(Block::new(kernel, points, neighbours.block(k), nugget)?.weights);
            }
            Some(all)
        };
        let chunks = neighbours.count().div_ceil(CHUNK);
        let rows: Option<Vec<Vec<f64>>> = (0..chunks).into_par_iter().map(rows).collect();
        let weights = rows?.concat();
        let own = |k: usize| weights[neighbours.range(k).end - 1];
        let log_determinant = (0..neighbours.count()).map(|k| -2.0 * own(k).ln()).sum();
        Some(Self { neighbours, weights, log_determinant })
    }

    /// Returns the conditional variance of the run of each block.
    pub fn variances(&self) -> Vec<f64> {
        let own = |k: usize| self.weights[self.neighbours.range(k).end - 1];
        (0..self.neighbours.count()).map(|k| own(k).powi(-2)).collect()
    }

    /// Returns `B Y` (`blocks x C`) for scores `Y` (`N x C`, in the order of the runs).
    pub fn whitened(&self, scores: &Matrix) -> Matrix {
        let mut white = Matrix::zeros(self.neighbours.count(), scores.columns());
        for k in 0..self.neighbours.count() {
            let weights = &self.weights[self.neighbours.range(k)];
            for (&run, &weight) in self.neighbours.block(k).iter().zip(weights) {
                vector::add_scaled(white.row_mut(k), weight, scores.row(run as usize));
            }
        }
        white
    }

    /// Returns `B' Z` (`N x C`, in the order of the runs) for `Z` (`N x C`) in the order of the blocks.
    pub fn coloured(&self, white: &Matrix) -> Matrix {
        let mut all = Matrix::zeros(white.rows(), white.columns());
        for k in 0..self.neighbours.count() {
            let weights = &self.weights[self.neighbours.range(k)];
            for (&run, &weight) in self.neighbours.block(k).iter().zip(weights) {
                vector::add_scaled(all.row_mut(run as usize), weight, white.row(k));
            }
        }
        all
    }

    /// Returns `B' B x`.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; x.len()];
        for k in 0..self.neighbours.count() {
            let (block, weights) =
                (self.neighbours.block(k), &self.weights[self.neighbours.range(k)]);
            let terms = block.iter().zip(weights);
            let white: f64 = terms.clone().map(|(&run, weight)| weight * x[run as usize]).sum();
            terms.for_each(|(&run, weight)| product[run as usize] += weight * white);
        }
        product
    }
}
