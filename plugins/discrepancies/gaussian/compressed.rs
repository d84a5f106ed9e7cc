//! Likelihood reduced to a small form in the basis functions of a linear emulator.
//!
//! With `m = C' psi` the weighted residual of a group is `z = -B (psi, 1)`, `B = [W C', -W ybar]`. Its part along the
//! directions `U` of the common errors is `-(U'B)(psi, 1)`; for the rest, the thin factorisation `(I - U U') B = Q R`
//! gives `|z_rest| = |R (psi, 1)|` with `R` upper trapezoidal. This is exact, since an orthogonal factor preserves
//! lengths.
//!
//! Only the length of the rest matters, and with a polynomial basis its square is one polynomial. Expanding the
//! square carries rounding errors of its largest values into its smallest, so that this form is used only if they are
//! negligible against the scatter of the replicates and the part of the data that no coefficients can explain.

use lacuna::plugin::discrepancy::Compressed;
use lacuna::plugin::forward::{Linear, SumOfSquares};
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;
use rayon::prelude::*;

use super::law::Law;
use super::likelihood::GaussianLikelihood;
use super::statistics::{Residual, Spread, Statistics};

/// The compressed likelihood (see the module).
pub(super) struct CompressedGaussian {
    law: Law,
    pub(super) groups: Vec<CompressedGroup>,
}

/// Residual of one group.
pub(super) struct CompressedGroup {
    spread: Spread,
    /// `(U'B)'` (`(terms + 1) x rank`).
    along: Matrix,
    /// `R'` (`(terms + 1) x` at most `terms + 1`), with zeros above its diagonal.
    outside: Matrix,
    /// `|R (psi, 1)|^2` as a polynomial of the point, if it is accurate enough.
    pub(super) squares: Option<Box<dyn SumOfSquares>>,
}

/// Residuals of a group at several points; those along the directions have the opposite sign.
struct Residuals {
    along: Matrix,
    squares: Vec<f64>,
}

/// Largest error of the sum of squares relative to the smallest possible sum: a tenth of the allowed difference of
/// the log-likelihood from the sum over all data.
const TOLERANCE: f64 = 1e-11;

impl CompressedGroup {
    fn new(s: &Statistics, linear: &dyn Linear) -> Result<Self, lacuna_linalg::Error> {
        let coefficients = linear.coefficients();
        let terms = coefficients.rows();
        let mut b = Matrix::from_fn(s.measured.len(), terms + 1, |i, j| {
            if j < terms {
                s.weight[i] * coefficients[(j, s.measured[i])]
            } else {
                -s.weighted_mean[i]
            }
        });
        let along = lacuna_linalg::multiply(&s.common.rows, &b);
        let explained = lacuna_linalg::transposed_multiply(&s.common.rows, &along);
        for (entry, part) in b.as_mut_slice().iter_mut().zip(explained.as_slice()) {
            *entry -= part;
        }
        // Of a million outputs each of these matrices takes hundreds of megabytes.
        drop(explained);
        let r = lacuna_linalg::triangular_factor(&b)?;
        drop(b);
        // The last entry of a square `R` is the distance of the data from the span of the basis.
        let distance = if r.rows() > terms { r[(terms, terms)] } else { 0.0 };
        let least = s.spread.scatter + distance * distance;
        let squares = linear.sum_of_squares(&r).filter(|q| q.error() <= TOLERANCE * least);
        let (along, outside) = (along.transposed(), r.transposed());
        Ok(Self { spread: s.spread.clone(), along, outside, squares })
    }

    fn residuals(&self, extended: &Matrix) -> Residuals {
        let along = lacuna_linalg::multiply(extended, &self.along);
        let outside = lacuna_linalg::multiply_lower(extended, &self.outside);
        Residuals { along, squares: outside.iter_rows().map(|row| dot(row, row)).collect() }
    }

    /// Returns the polynomial of the squares, if it is valid at all points.
    fn covering(&self, points: &Matrix) -> Option<&dyn SumOfSquares> {
        self.squares.as_deref().filter(|squares| squares.covers_all(points))
    }

    /// Returns the contribution of the directions to the derivatives with respect to the basis functions.
    fn pull(&self, along: &[f64], terms: usize) -> Vec<f64> {
        let opposite: Vec<f64> = along.iter().map(|a| -a).collect();
        let mut pull = lacuna_linalg::multiply_vector(&self.along, &opposite);
        pull.truncate(terms);
        pull
    }
}

impl CompressedGaussian {
    pub(super) fn new(
        likelihood: &GaussianLikelihood,
        linear: &dyn Linear,
    ) -> Result<Self, lacuna_linalg::Error> {
        let groups = likelihood.groups.iter().map(|s| CompressedGroup::new(s, linear));
        Ok(Self { law: likelihood.law.clone(), groups: groups.collect::<Result<_, _>>()? })
    }

    fn spreads(&self) -> Vec<&Spread> {
        self.groups.iter().map(|g| &g.spread).collect()
    }

    fn values(&self, residuals: &[Residuals], hyper: &Matrix) -> Vec<f64> {
        let spreads = self.spreads();
        let one = |i: usize| {
            let each = residuals.iter();
            let at_point: Vec<Residual<'_>> =
                each.map(|r| Residual { outside: r.squares[i], along: r.along.row(i) }).collect();
            self.law.log_likelihood(&spreads, hyper.row(i), &at_point)
        };
        // Coupled groups take a factorisation at each point.
        if matches!(self.law, Law::Coupled(_)) {
            return (0..hyper.rows()).into_par_iter().map(one).collect();
        }
        (0..hyper.rows()).map(one).collect()
    }
}

/// Appends a column of ones to the basis, so that the emulator's coefficients and the data form one factor.
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
        let residuals: Vec<Residuals> =
            self.groups.iter().map(|g| g.residuals(&extended)).collect();
        self.values(&residuals, hyper)
    }

    fn log_likelihood_at(&self, linear: &dyn Linear, points: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let needed = |g: &CompressedGroup| g.along.columns() > 0 || g.covering(points).is_none();
        let extended = if self.groups.iter().any(needed) {
            with_one(&linear.basis(points))
        } else {
            Matrix::zeros(points.rows(), 0)
        };
        let residuals = |group: &CompressedGroup| {
            let Some(squares) = group.covering(points) else { return group.residuals(&extended) };
            let along = if group.along.columns() == 0 {
                Matrix::zeros(points.rows(), 0)
            } else {
                lacuna_linalg::multiply(&extended, &group.along)
            };
            Residuals { along, squares: squares.values(points) }
        };
        let residuals: Vec<Residuals> = self.groups.iter().map(residuals).collect();
        self.values(&residuals, hyper)
    }

    fn gradient(&self, basis: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let extended: Vec<f64> = basis.iter().copied().chain([1.0]).collect();
        let parts: Vec<(Vec<f64>, Vec<f64>)> = (self.groups.iter())
            .map(|g| {
                let along = lacuna_linalg::transposed_multiply_vector(&g.along, &extended);
                (along, lacuna_linalg::transposed_multiply_vector(&g.outside, &extended))
            })
            .collect();
        let residuals: Vec<Residual<'_>> = parts
            .iter()
            .map(|(along, outside)| Residual { outside: dot(outside, outside), along })
            .collect();
        let mut by_basis = vec![0.0; basis.len()];
        let Some(slopes) = self.law.slopes(&self.spreads(), hyper, &residuals) else {
            return (by_basis, vec![0.0; hyper.len()]);
        };
        for (g, (group, (_, outside))) in self.groups.iter().zip(&parts).enumerate() {
            let pull = group.pull(&slopes.along[g], basis.len());
            let rest = lacuna_linalg::multiply_vector(&group.outside, outside);
            for (sum, (p, r)) in by_basis.iter_mut().zip(pull.iter().zip(rest)) {
                *sum += p - r / slopes.outside[g];
            }
        }
        (by_basis, slopes.by_hyper)
    }

    fn gradient_at(
        &self,
        linear: &dyn Linear,
        point: &[f64],
        hyper: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let row = Matrix::from_rows(point.len(), [point]);
        let all: Option<Vec<_>> = self.groups.iter().map(|g| g.covering(&row)).collect();
        let Some(squares) = all else {
            let (by_basis, by_hyper) = self.gradient(linear.basis(&row).row(0), hyper);
            let slopes = linear.basis_gradient(point);
            return (lacuna_linalg::transposed_multiply_vector(&slopes, &by_basis), by_hyper);
        };
        let directions = self.groups.iter().any(|g| g.along.columns() > 0);
        let extended = directions.then(|| with_one(&linear.basis(&row)));
        let along = |group: &CompressedGroup| {
            let along = extended
                .as_ref()
                .map(|e| lacuna_linalg::transposed_multiply_vector(&group.along, e.row(0)));
            along.unwrap_or_default()
        };
        let along: Vec<Vec<f64>> = self.groups.iter().map(along).collect();
        let residuals: Vec<Residual<'_>> = squares
            .iter()
            .zip(&along)
            .map(|(s, along)| Residual { outside: s.values(&row)[0], along })
            .collect();
        let mut by_point = vec![0.0; point.len()];
        let Some(slopes) = self.law.slopes(&self.spreads(), hyper, &residuals) else {
            return (by_point, vec![0.0; hyper.len()]);
        };
        for (s, v) in squares.iter().zip(&slopes.outside) {
            let gradient = s.gradient(point);
            by_point.iter_mut().zip(gradient).for_each(|(sum, g)| *sum += -0.5 * g / v);
        }
        if let Some(extended) = extended {
            let terms = extended.columns() - 1;
            let mut pull = vec![0.0; terms];
            for (group, along) in self.groups.iter().zip(&slopes.along) {
                pull.iter_mut().zip(group.pull(along, terms)).for_each(|(sum, p)| *sum += p);
            }
            let added =
                lacuna_linalg::transposed_multiply_vector(&linear.basis_gradient(point), &pull);
            by_point.iter_mut().zip(added).for_each(|(g, a)| *g += a);
        }
        (by_point, slopes.by_hyper)
    }
}
