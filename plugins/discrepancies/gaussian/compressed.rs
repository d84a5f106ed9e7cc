//! The likelihood reduced to a small form in the basis functions of a linear emulator.
//!
//! With `m = C' psi` the weighted residual is `z = -B (psi, 1)`, `B = [W C', -W ybar]`. Its part along the
//! directions `U` of the emulator's error is `-(U'B)(psi, 1)`; for the rest, the thin factorisation
//! `(I - U U') B = Q R` gives `|z_rest| = |R (psi, 1)|` with `R` upper triangular of the basis' size: exact, since
//! an orthogonal factor does not change a length.

use lacuna::linalg::{self, Matrix};
use lacuna::plugin::discrepancy::Compressed;

use lacuna::linalg::vector::dot;

use super::likelihood::{Spread, Statistics};

/// See the module.
pub(super) struct CompressedGaussian {
    spread: Spread,
    /// `U'B`, `rank x (terms + 1)`.
    along: Matrix,
    /// `R`, at most `(terms + 1) x (terms + 1)`.
    outside: Matrix,
}

impl CompressedGaussian {
    pub(super) fn new(
        statistics: &Statistics,
        coefficients: &Matrix,
    ) -> Result<Self, linalg::Error> {
        let terms = coefficients.rows();
        let s = statistics;
        let mut b = Matrix::from_fn(s.measured.len(), terms + 1, |i, j| {
            if j < terms {
                s.weight[i] * coefficients[(j, s.measured[i])]
            } else {
                -s.weighted_mean[i]
            }
        });
        let along = linalg::multiply(&s.directions, &b);
        let explained = linalg::transposed_multiply(&s.directions, &along);
        for (entry, part) in b.as_mut_slice().iter_mut().zip(explained.as_slice()) {
            *entry -= part;
        }
        let outside = if b.rows() > b.columns() { linalg::thin_qr(&b)?.r } else { b };
        Ok(Self { spread: s.spread.clone(), along, outside })
    }
}

/// The basis with a column of ones: the emulator's coefficients and the data in one factor.
fn with_one(basis: &Matrix) -> Matrix {
    let terms = basis.columns();
    let mut extended = Matrix::zeros(basis.rows(), terms + 1);
    for i in 0..basis.rows() {
        extended.row_mut(i)[..terms].copy_from_slice(basis.row(i));
        extended.row_mut(i)[terms] = 1.0;
    }
    extended
}

impl Compressed for CompressedGaussian {
    fn log_likelihood(&self, basis: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let extended = with_one(basis);
        let along = linalg::multiply_transposed(&extended, &self.along);
        let outside = linalg::multiply_transposed(&extended, &self.outside);
        (0..basis.rows())
            .map(|i| {
                let v = hyper[(i, 0)];
                if v.is_nan() || v <= 0.0 {
                    return f64::NEG_INFINITY;
                }
                let rest = outside.row(i);
                self.spread.log_likelihood(v, dot(rest, rest), along.row(i))
            })
            .collect()
    }

    fn gradient(&self, basis: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let v = hyper[0];
        let terms = basis.len();
        let extended: Vec<f64> = basis.iter().copied().chain([1.0]).collect();
        let along: Vec<f64> = self.along.iter_rows().map(|row| dot(row, &extended)).collect();
        let outside: Vec<f64> = self.outside.iter_rows().map(|row| dot(row, &extended)).collect();
        let mut by_basis = vec![0.0; terms];
        let mut subtract = |row: &[f64], scale: f64| {
            for (g, entry) in by_basis.iter_mut().zip(row) {
                *g -= scale * entry;
            }
        };
        for (row, r) in self.outside.iter_rows().zip(&outside) {
            subtract(row, r / v);
        }
        for ((row, a), lambda) in self.along.iter_rows().zip(&along).zip(&self.spread.eigenvalues) {
            subtract(row, a / (v + lambda));
        }
        let by_variance = self.spread.by_variance(v, dot(&outside, &outside), &along);
        (by_basis, vec![by_variance])
    }
}
