//! The inverse covariance of the mean curve, as far as derivatives need it.

use lacuna::linalg::vector::dot;
use lacuna::linalg::{self, Matrix};

use super::bias::{Bias, add};
use super::filter::Traces;
use super::solve::Solved;

/// `V^-1 = A^-1 + E E' - K K'` in the terms of [`Solved`].
pub(super) struct Precision<'a> {
    solved: &'a Solved<'a>,
    /// `V^-1 d` for the residual `d` of the means.
    pub pull: Vec<f64>,
    /// The diagonal of `V^-1`.
    pub diagonal: Vec<f64>,
    traces: Vec<Traces>,
    /// `Y`.
    inverse_image: Matrix,
    /// `E = Y N^-1/2'`.
    added: Matrix,
    /// `K = B^-1 F Q^-1/2'`.
    taken: Matrix,
}

/// `X L^-1'` for the factor `L L'`.
fn half(x: &Matrix, factor: &linalg::Cholesky) -> Matrix {
    factor.whiten_matrix(&x.transposed()).transposed()
}

impl Solved<'_> {
    /// See [`Precision`].
    pub fn precision(&self) -> Precision<'_> {
        let (n, r) = (self.residual.len(), self.factor.columns());
        let (mut inverse_image, mut added) = (Matrix::zeros(n, 0), Matrix::zeros(n, 0));
        let mut inverse_factor = Matrix::zeros(n, r);
        for i in 0..n {
            inverse_factor.row_mut(i).copy_from_slice(self.white.row(i));
        }
        self.back(&mut inverse_factor);
        if let Some(inner) = &self.inner {
            inverse_image = inner.white.clone();
            self.back(&mut inverse_image);
            added = half(&inverse_image, &inner.reduced);
            let below: Vec<usize> = (n..self.white.rows()).collect();
            let along = linalg::multiply(&added, &self.white.select_rows(&below));
            add(&mut inverse_factor, 1.0, &along);
        }
        let taken = half(&inverse_factor, &self.capacitance);
        let traces: Vec<Traces> = self.filters.iter().map(super::filter::Filter::traces).collect();
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
    /// The derivatives of the log density by the standard deviation and the length of each series:
    /// half the trace of `P' (pull pull' - V^-1) P` with that of `C`, for the projection
    /// `P = I - H S^-1 G'`.
    pub fn by_process(&self) -> Vec<[f64; 2]> {
        let solved = self.solved;
        let (left, right) = self.columns();
        let bias = solved.bias;
        // Series with one covariance together.
        let mut found = vec![[0.0; 2]; bias.blocks.len()];
        for (s, block) in bias.blocks.iter().enumerate() {
            let Some([covariance, slope]) = bias.of(&solved.covariances, s) else { continue };
            let (sd, _) = Bias::of_block(block, solved.values);
            let rows = |m: &Matrix| m.select_rows(&block.rows);
            let by = linalg::multiply_transposed(&rows(&left), &rows(&right));
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

    /// `X` and `Z` with `X Z' = P' (pull pull' - V^-1) P + A^-1` on the blocks of the diagonal.
    fn columns(&self) -> (Matrix, Matrix) {
        let n = self.pull.len();
        let pull = Matrix::from_vec(n, 1, self.pull.clone());
        let mut plain = beside(&[&pull, &self.added, &self.taken]);
        let Some(inner) = &self.solved.inner else {
            return (plain.clone(), plain);
        };
        // P' X = X - G S^-1 (H' X).
        let basis = &self.solved.bias.basis;
        let along = inner.outer.solve_matrix(&linalg::transposed_multiply(&inner.image, &plain));
        add(&mut plain, -1.0, &linalg::multiply(basis, &along));
        let mut signed = plain.clone();
        let taken = 1..=self.added.columns();
        for i in 0..n {
            signed.row_mut(i)[taken.clone()].iter_mut().for_each(|x| *x = -*x);
        }
        // P' A^-1 P = A^-1 - G T' - T G' + G M G' with T = Y S^-1, M = S^-1 H'T.
        let turned = inner.outer.solve_matrix(&self.inverse_image.transposed()).transposed();
        let middle = linalg::transposed_multiply(&inner.image, &turned);
        let middle = inner.outer.solve_matrix(&middle);
        let mut other = turned.clone();
        add(&mut other, -1.0, &linalg::multiply_transposed(basis, &middle));
        (beside(&[&plain, basis, &turned]), beside(&[&signed, &other, basis]))
    }
}

/// Matrices of as many rows side by side.
fn beside(parts: &[&Matrix]) -> Matrix {
    let width = parts.iter().map(|m| m.columns()).sum();
    let rows = parts.first().map_or(0, |m| m.rows());
    let mut all = Matrix::zeros(rows, width);
    for i in 0..rows {
        let mut start = 0;
        for part in parts {
            all.row_mut(i)[start..start + part.columns()].copy_from_slice(part.row(i));
            start += part.columns();
        }
    }
    all
}
