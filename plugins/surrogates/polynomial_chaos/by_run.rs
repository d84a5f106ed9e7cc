//! Assessment of fits to values and slopes by leaving out one run after the other, each with its slopes.
//!
//! With `H` the hat matrix, the residuals of a run for the fit without it are `(1 - H_b)^-1 r_b`, with the block of the
//! run's own rows. Its first entry is the error of the value there, and only this one counts: the fit is to predict
//! values.

use lacuna_linalg::{Cholesky, Matrix, multiply_transposed};

use super::judge::correction;

/// Fraction of the terms by which a set must have grown since the last assessment, except for small sets.
const GROWTH: usize = 16;

/// Leave-one-run-out errors of a least-squares fit to values and slopes, updated as terms are added.
pub(super) struct ByRun {
    /// Block of `1 - H` for each run.
    blocks: Vec<Matrix>,
    /// Number of values and known slopes.
    known: usize,
    /// Number of terms from which the next set is assessed.
    next: usize,
}

/// Returns the rows of one run: its value, then its slopes.
fn rows(run: usize, runs: usize, height: usize) -> impl Iterator<Item = usize> {
    (run..height).step_by(runs)
}

/// Returns the errors of the values of each run for the fit without it; infinite if the other runs do not determine the
/// fit.
fn left_out(blocks: &[Matrix], residual: &[f64]) -> Vec<f64> {
    let runs = blocks.len();
    let error = |(run, block): (usize, &Matrix)| {
        let mut own: Vec<f64> = rows(run, runs, residual.len()).map(|row| residual[row]).collect();
        let Ok(factor) = Cholesky::new(block) else { return f64::INFINITY };
        factor.solve(&mut own);
        own[0]
    };
    blocks.iter().enumerate().map(error).collect()
}

impl ByRun {
    /// Starts with the constant alone.
    pub fn new(runs: usize, dimension: usize, known: usize) -> Self {
        let size = 1 + dimension;
        let block = Matrix::from_fn(size, size, |i, j| {
            let constant = if i == 0 && j == 0 { 1.0 / runs as f64 } else { 0.0 };
            f64::from(u8::from(i == j)) - constant
        });
        Self { blocks: vec![block; runs], known, next: 1 }
    }

    /// Adds one orthonormal column.
    pub fn add(&mut self, column: &[f64]) {
        let runs = self.blocks.len();
        let mut own = Vec::new();
        for (run, block) in self.blocks.iter_mut().enumerate() {
            own.clear();
            own.extend(rows(run, runs, column.len()).map(|row| column[row]));
            for (i, &x) in own.iter().enumerate().filter(|(_, x)| **x != 0.0) {
                block.row_mut(i).iter_mut().zip(&own).for_each(|(entry, y)| *entry -= x * y);
            }
        }
    }

    /// Returns the sum of squares of the errors at runs left out, times the correction for the number of terms; `None`
    /// if the set has hardly grown since the last assessment and is not the `last`.
    pub fn squares(
        &mut self,
        residual: &[f64],
        terms: usize,
        trace: f64,
        last: bool,
    ) -> Option<f64> {
        if terms < self.next && !last {
            return None;
        }
        self.next = terms + (terms / GROWTH).max(1);
        let squares: f64 = left_out(&self.blocks, residual).iter().map(|e| e * e).sum();
        Some(squares * correction(self.known, terms, trace))
    }
}

/// Blocks of `1 - H` of a fit with these orthonormal columns (`rows x terms`), for leave-one-run-out errors.
pub(super) struct Blocks(Vec<Matrix>);

impl Blocks {
    /// Computes the blocks of all runs.
    pub fn of(orthonormal: &Matrix, runs: usize) -> Self {
        let block = |run: usize| {
            let own: Vec<usize> = rows(run, runs, orthonormal.rows()).collect();
            let own = orthonormal.select_rows(&own);
            let hat = multiply_transposed(&own, &own);
            let size = own.rows();
            Matrix::from_fn(size, size, |i, j| f64::from(u8::from(i == j)) - hat[(i, j)])
        };
        Self((0..runs).map(block).collect())
    }

    /// Returns the errors of the values of each run for the fit without it, from the residuals of the fit to all runs.
    pub fn left_out(&self, residual: &[f64]) -> Vec<f64> {
        left_out(&self.0, residual)
    }
}
