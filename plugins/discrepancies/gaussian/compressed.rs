//! The likelihood reduced to a small form in the basis functions of a linear emulator.
//!
//! With `m = C' psi` the weighted residual is `z = -B (psi, 1)`, `B = [W C', -W ybar]`. Its part along the
//! directions `U` of the common errors is `-(U'B)(psi, 1)`; for the rest, the thin factorisation
//! `(I - U U') B = Q R` gives `|z_rest| = |R (psi, 1)|` with `R` upper trapezoidal: exact, since an orthogonal
//! factor does not change a length.
//!
//! Only the length of the rest matters, and a polynomial basis gives its square as one polynomial. That form
//! carries the round-off of its largest values into its smallest, so that it is used only where
//! this cannot be seen: against the scatter of the replicates and what no coefficients can explain.

use lacuna::linalg::vector::dot;
use lacuna::linalg::{self, Matrix};
use lacuna::plugin::discrepancy::Compressed;
use lacuna::plugin::surrogate::{Linear, SumOfSquares};

use super::likelihood::{Spread, Statistics};

/// See the module.
pub(super) struct CompressedGaussian {
    spread: Spread,
    /// `(U'B)'`, `(terms + 1) x rank`.
    along: Matrix,
    /// `R'`, `(terms + 1) x` at most `terms + 1`, with zeros above its diagonal.
    outside: Matrix,
    /// `|R (psi, 1)|^2` as a function of the point, where it is exact enough.
    pub(super) squares: Option<Box<dyn SumOfSquares>>,
}

/// The largest error of the sum of squares, relative to the least sum that can occur: a tenth of what
/// the log-likelihood may differ from the sum over all data.
const TOLERANCE: f64 = 1e-11;

impl CompressedGaussian {
    pub(super) fn new(s: &Statistics, linear: &dyn Linear) -> Result<Self, linalg::Error> {
        let coefficients = linear.coefficients();
        let terms = coefficients.rows();
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
        let r = linalg::thin_qr(&b)?.r;
        // The last entry of a square `R` is the distance of the data from all that the basis can make.
        let distance = if r.rows() > terms { r[(terms, terms)] } else { 0.0 };
        let least = s.spread.scatter + distance * distance;
        let squares = linear.sum_of_squares(&r).filter(|q| q.error() <= TOLERANCE * least);
        let (along, outside) = (along.transposed(), r.transposed());
        Ok(Self { spread: s.spread.clone(), along, outside, squares })
    }

    fn with_squares(&self, along: &Matrix, squares: &[f64], hyper: &Matrix) -> Vec<f64> {
        (squares.iter().enumerate())
            .map(|(i, &squares)| {
                let v = hyper[(i, 0)];
                if v.is_nan() || v <= 0.0 {
                    return f64::NEG_INFINITY;
                }
                self.spread.log_likelihood(v, squares, along.row(i))
            })
            .collect()
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
        let along = linalg::multiply(&extended, &self.along);
        let outside = linalg::multiply_lower(&extended, &self.outside);
        let squares: Vec<f64> = outside.iter_rows().map(|row| dot(row, row)).collect();
        self.with_squares(&along, &squares, hyper)
    }

    fn log_likelihood_at(&self, linear: &dyn Linear, points: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let covering = |s: &&Box<dyn SumOfSquares>| points.iter_rows().all(|p| s.covers(p));
        let Some(squares) = self.squares.as_ref().filter(covering) else {
            return self.log_likelihood(&linear.basis(points), hyper);
        };
        let along = if self.along.columns() == 0 {
            Matrix::zeros(points.rows(), 0)
        } else {
            linalg::multiply(&with_one(&linear.basis(points)), &self.along)
        };
        self.with_squares(&along, &squares.values(points), hyper)
    }

    fn gradient(&self, basis: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let v = hyper[0];
        let extended: Vec<f64> = basis.iter().copied().chain([1.0]).collect();
        let along = linalg::transposed_multiply_vector(&self.along, &extended);
        let outside = linalg::transposed_multiply_vector(&self.outside, &extended);
        let weights: Vec<f64> = along
            .iter()
            .zip(&self.spread.eigenvalues)
            .map(|(a, lambda)| a / (v + lambda))
            .collect();
        let pull = linalg::multiply_vector(&self.along, &weights);
        let rest = linalg::multiply_vector(&self.outside, &outside);
        let by_basis = (0..basis.len()).map(|j| -pull[j] - rest[j] / v).collect();
        let by_variance = self.spread.by_variance(v, dot(&outside, &outside), &along);
        (by_basis, vec![by_variance])
    }
}
