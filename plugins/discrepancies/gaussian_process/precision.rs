//! The parts of the inverse covariance of the mean curve that derivatives need.

use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Cholesky, Matrix};

use super::filter::{Filter, Traces};
use super::solve::Solved;
use crate::discrepancies::common::Block;

/// `V^-1 = A^-1 + E E' - K K'`, in the notation of [`Solved`].
pub(super) struct Precision<'a> {
    solved: &'a Solved<'a>,
    /// `V^-1 d` for the residual `d` of the means.
    pub pull: Vec<f64>,
    /// Diagonal of `V^-1`.
    pub diagonal: Vec<f64>,
    traces: Vec<Traces>,
    /// `Y`.
    inverse_image: Matrix,
    /// `E = Y N^-1/2'`.
    added: Matrix,
    /// `K = B^-1 F Q^-1/2'`.
    taken: Matrix,
}

/// Returns `X L^-1'` for the factor `L L'`.
fn half(x: &Matrix, factor: &Cholesky) -> Matrix {
    lacuna_linalg::multiply_transposed(x, &factor.lower_inverse())
}

impl Solved<'_> {
    /// Computes the [`Precision`].
    pub fn precision(&self) -> Precision<'_> {
        let (n, r) = (self.residual.len(), self.factor.columns());
        let (mut inverse_image, mut added) = (Matrix::zeros(n, 0), Matrix::zeros(n, 0));
        let mut inverse_factor = Matrix::from_vec(n, r, self.white.as_slice()[..n * r].to_vec());
        self.back(&mut inverse_factor);
        if let Some(inner) = &self.inner {
            inverse_image = inner.white.clone();
            self.back(&mut inverse_image);
            added = half(&inverse_image, &inner.reduced);
            let below: Vec<usize> = (n..self.white.rows()).collect();
            let below = self.white.select_rows(&below);
            for i in 0..n {
                for (&weight, row) in added.row(i).iter().zip(below.iter_rows()) {
                    add_scaled(inverse_factor.row_mut(i), weight, row);
                }
            }
        }
        let taken = half(&inverse_factor, &self.capacitance);
        let traces: Vec<Traces> = self.filters.iter().map(Filter::traces).collect();
        let mut diagonal = vec![0.0; n];
        for (block, traces) in self.bias.blocks.iter().zip(&traces) {
            for (&row, own) in block.rows.iter().zip(&traces.diagonal) {
                let (e, t) = (added.row(row), taken.row(row));
                diagonal[row] = own + dot(e, e) - dot(t, t);
            }
        }
        let pull = self.pull(&added);
        Precision { solved: self, pull, diagonal, traces, inverse_image, added, taken }
    }
}

impl Precision<'_> {
    /// Returns the derivatives of the log density with respect to the standard deviation and the correlation length
    /// of each series: half the trace of `P' (pull pull' - V^-1) P` with the derivative of `C`, for the projection
    /// `P = I - H S^-1 G'`.
    pub fn by_process(&self) -> Vec<[f64; 2]> {
        let solved = self.solved;
        let bias = solved.bias;
        let turned = self.turned();
        let mut found = vec![[0.0; 2]; bias.blocks.len()];
        for (s, block) in bias.blocks.iter().enumerate() {
            let Some([covariance, slope]) = bias.of(&solved.covariances, s) else { continue };
            let (sd, _) = block.of(solved.values);
            let (left, right) = self.columns(block, turned.as_ref());
            let by = lacuna_linalg::multiply_transposed(&left, &right);
            // tr(A^-1 C) = tr(I - A^-1 D).
            let noisy = block.rows.iter().zip(&self.traces[s].diagonal);
            let own: f64 = noisy.map(|(&row, d)| 1.0 - solved.noise[row] * d).sum();
            found[s] = [
                (dot(by.as_slice(), covariance.as_slice()) - own) / sd,
                0.5 * (dot(by.as_slice(), slope.as_slice()) - self.traces[s].by_length),
            ];
        }
        found
    }

    /// Applies the projection to `pull`, `E`, `K` and `A^-1`; `None` without projection.
    fn turned(&self) -> Option<Turned> {
        let inner = self.solved.inner.as_ref()?;
        let (p, q, r) = (inner.image.columns(), self.added.columns(), self.taken.columns());
        let mut along = Matrix::zeros(p, 1 + q + r);
        for (i, row) in inner.image.iter_rows().enumerate() {
            for (k, &weight) in row.iter().enumerate() {
                let sum = along.row_mut(k);
                sum[0] += weight * self.pull[i];
                add_scaled(&mut sum[1..=q], weight, self.added.row(i));
                add_scaled(&mut sum[1 + q..], weight, self.taken.row(i));
            }
        }
        let inverse = inner.outer.solve_matrix(&self.inverse_image.transposed()).transposed();
        let middle = lacuna_linalg::transposed_multiply(&inner.image, &inverse);
        let middle = inner.outer.solve_matrix(&middle);
        Some(Turned { along: inner.outer.solve_matrix(&along), inverse, middle })
    }

    /// Returns `X` and `Z` with `X Z' = P' (pull pull' - V^-1) P + A^-1` at a series.
    fn columns(&self, block: &Block, turned: Option<&Turned>) -> (Matrix, Matrix) {
        let basis = &self.solved.bias.basis;
        let (p, q, r) = (basis.columns(), self.added.columns(), self.taken.columns());
        let own = 1 + q + r;
        let width = if turned.is_some() { own + 2 * p } else { own };
        let mut left = Matrix::zeros(block.rows.len(), width);
        let mut right = Matrix::zeros(block.rows.len(), width);
        for (k, &i) in block.rows.iter().enumerate() {
            let (x, z) = (left.row_mut(k), right.row_mut(k));
            x[0] = self.pull[i];
            x[1..=q].copy_from_slice(self.added.row(i));
            x[1 + q..own].copy_from_slice(self.taken.row(i));
            if let Some(Turned { along, inverse, middle }) = turned {
                // P' X = X - G S^-1 (H' X).
                for (&weight, row) in basis.row(i).iter().zip(along.iter_rows()) {
                    add_scaled(&mut x[..own], -weight, row);
                }
                // P' A^-1 P = A^-1 - G T' - T G' + G M G'.
                x[own..own + p].copy_from_slice(basis.row(i));
                x[own + p..].copy_from_slice(inverse.row(i));
                z[own + p..].copy_from_slice(basis.row(i));
                for (j, t) in inverse.row(i).iter().enumerate() {
                    z[own + j] = t - dot(middle.row(j), basis.row(i));
                }
            }
            z[..own].copy_from_slice(&x[..own]);
            z[1..=q].iter_mut().for_each(|x| *x = -*x);
        }
        (left, right)
    }
}

/// Projected matrices (see [`Precision::turned`]).
struct Turned {
    /// `S^-1 H' X` for the columns `X` of `pull`, `E` and `K`.
    along: Matrix,
    /// `T = Y S^-1`.
    inverse: Matrix,
    /// `M = S^-1 H'T`, symmetric.
    middle: Matrix,
}
