//! Sufficient statistics of outputs that share a variance.
//!
//! With `n_i` replicates of output `i`, mean `ybar_i` and scatter `S_i = sum_r (y_ir - ybar_i)^2`, and the residual
//! `z_i = sqrt(n_i) (ybar_i - m_i)`, the log-likelihood is
//!
//! ```text
//! log L = -1/2 [ N log(2 pi v) + (sum_i S_i)/v + log det(I + K/v) + z' (v I + K)^-1 z ]
//! ```
//!
//! where `K = W F F' W`, `W = diag(sqrt(n_i))`, is the covariance `F F'` of the common errors as it enters `z`. The
//! thin singular value decomposition `W F = U diag(s) V'` diagonalises `K` once for all `v`. If the variance is a
//! multiple of a known one, all of these are statistics of the data divided by its root.

use std::sync::Arc;

use lacuna::plugin::discrepancy::CommonError;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;

use crate::discrepancies::common::{Replicates, WeightedDirections, WeightedFactor};

/// Statistics of the data of one group and of the common errors.
#[derive(Debug, Clone)]
pub(super) struct Statistics {
    /// Outputs that were measured at least once.
    pub measured: Vec<usize>,
    /// `sqrt(n_i)` of each output over the root of its scale.
    pub weight: Vec<f64>,
    /// Weight times `ybar_i` of each output.
    pub weighted_mean: Vec<f64>,
    /// Statistics that do not depend on the response.
    pub spread: Spread,
    /// Directions of the common errors, which parts of the data with the same weights share.
    pub common: Arc<Directions>,
}

/// Directions of the common errors of a group.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Directions {
    /// `U'` (`rank x measured`).
    pub rows: Matrix,
    /// Eigenvalues of `K`; empty if the common errors couple several groups.
    pub eigenvalues: Vec<f64>,
}

impl Directions {
    /// No directions among some outputs.
    fn none(measured: usize) -> Self {
        Self { rows: Matrix::zeros(0, measured), eigenvalues: Vec::new() }
    }
}

/// Statistics that do not depend on the response.
#[derive(Debug, Clone)]
pub(super) struct Spread {
    /// Number of data.
    pub count: f64,
    /// Sum of squared deviations of the replicates from their means.
    pub scatter: f64,
    /// Sum of the logarithms of the data's scales.
    pub log_scale: f64,
    /// Eigenvalues of `K`.
    pub eigenvalues: Vec<f64>,
}

/// Residual of a group: its squared length outside the directions of the common errors, and its component along each
/// direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Residual<'a> {
    pub outside: f64,
    pub along: &'a [f64],
}

/// Number of directions summed side by side, so that the loop is vectorised.
const LANES: usize = 8;

impl Spread {
    /// Returns the log-likelihood given the variance and the residual.
    pub fn log_likelihood(&self, v: f64, residual: Residual<'_>) -> f64 {
        let (log_determinant, squares) = self.common(v, residual.along);
        let own = self.count * (std::f64::consts::TAU * v).ln() + self.log_scale;
        -0.5 * (own + log_determinant + (self.scatter + residual.outside + squares) / v)
    }

    /// Returns `log det(I + K/v)`, and the sum of the squared residuals along the directions, each divided by
    /// `1 + lambda / v`.
    ///
    /// Logarithms dominate the cost: one is taken of the product of as many factors as cannot overflow.
    fn common(&self, v: f64, along: &[f64]) -> (f64, f64) {
        let largest = 1.0 + self.eigenvalues.iter().copied().fold(0.0, f64::max) / v;
        let factors = ((600.0 / largest.ln()).min(1e6) as usize).max(1);
        let (mut log_determinant, mut squares) = (0.0, [0.0; LANES]);
        let runs = self.eigenvalues.chunks(LANES * factors);
        for (lambda, along) in runs.zip(along.chunks(LANES * factors)) {
            let mut product = [1.0; LANES];
            let (lambda, rest_lambda) = lambda.as_chunks::<LANES>();
            let (along, rest_along) = along.as_chunks::<LANES>();
            for (lambda, a) in lambda.iter().zip(along) {
                for l in 0..LANES {
                    let factor = 1.0 + lambda[l] / v;
                    product[l] *= factor;
                    squares[l] += a[l] * a[l] / factor;
                }
            }
            log_determinant += product.iter().map(|p| p.ln()).sum::<f64>();
            for (lambda, a) in rest_lambda.iter().zip(rest_along) {
                log_determinant += (lambda / v).ln_1p();
                squares[0] += a * a / (1.0 + lambda / v);
            }
        }
        (log_determinant, squares.iter().sum())
    }

    /// Returns the derivative of the log-likelihood with respect to the variance.
    pub fn by_variance(&self, v: f64, residual: Residual<'_>) -> f64 {
        let mut twice = self.count / v - (self.scatter + residual.outside) / (v * v);
        for (&a, &lambda) in residual.along.iter().zip(&self.eigenvalues) {
            twice -= lambda / (v * (v + lambda)) + (a / (v + lambda)).powi(2);
        }
        -0.5 * twice
    }
}

impl Statistics {
    /// Returns the statistics of the outputs for which `chosen` holds; directions and eigenvalues are those of the
    /// common errors of these outputs alone.
    pub fn of(
        replicates: &Replicates,
        common: &[CommonError],
        scale: &[f64],
        chosen: impl Fn(usize) -> bool,
    ) -> Result<Self, Stop> {
        let statistics = Self::without_common(replicates, scale, chosen);
        let common = Arc::new(statistics.common_directions(common)?);
        Ok(statistics.along(common))
    }

    /// Sets the directions of the common errors.
    pub fn along(mut self, common: Arc<Directions>) -> Self {
        self.spread.eigenvalues.clone_from(&common.eigenvalues);
        self.common = common;
        self
    }

    /// The statistics of a part of the data, with the directions that `other` gives for weights other than these; `None`
    /// without directions or if an output is missing altogether.
    pub fn of_part(
        &self,
        replicates: &Replicates,
        scale: &[f64],
        other: impl FnOnce(&Self) -> Option<Arc<Directions>>,
    ) -> Option<Self> {
        let own = |i: usize| self.measured.binary_search(&i).is_ok();
        let part = Self::without_common(replicates, scale, own);
        if part.measured != self.measured {
            return None;
        }
        let same = part.weight == self.weight;
        let directions = if same { Some(Arc::clone(&self.common)) } else { other(&part) };
        directions.map(|directions| part.along(directions))
    }

    /// Like [`Statistics::of`], without common errors.
    pub fn without_common(
        replicates: &Replicates,
        scale: &[f64],
        chosen: impl Fn(usize) -> bool,
    ) -> Self {
        let r = replicates;
        let kept: Vec<usize> = (0..r.measured.len()).filter(|&k| chosen(r.measured[k])).collect();
        let scales = || kept.iter().map(|&k| scale[r.measured[k]]);
        let counts = || kept.iter().map(|&k| r.count[k]);
        let weight: Vec<f64> = counts().zip(scales()).map(|(n, s)| n.sqrt() / s.sqrt()).collect();
        let spread = Spread {
            count: counts().sum(),
            scatter: kept.iter().zip(scales()).map(|(&k, s)| r.scatter[k] / s).sum(),
            log_scale: counts().zip(scales()).map(|(n, s)| n * s.ln()).sum(),
            eigenvalues: Vec::new(),
        };
        Self {
            measured: kept.iter().map(|&k| r.measured[k]).collect(),
            weighted_mean: kept.iter().zip(&weight).map(|(&k, w)| w * r.mean[k]).collect(),
            common: Arc::new(Directions::none(kept.len())),
            weight,
            spread,
        }
    }

    /// Returns the factor of the common errors as it enters the residual (`measured x columns`).
    pub fn weighted(&self, common: &[CommonError]) -> Matrix {
        WeightedFactor::of(common, &self.measured, &self.weight).whole()
    }

    /// Returns eigenvectors and eigenvalues of the covariance `K` of all common errors.
    pub fn common_directions(&self, common: &[CommonError]) -> Result<Directions, Stop> {
        let WeightedDirections { rows, values } =
            WeightedFactor::of(common, &self.measured, &self.weight).directions()?;
        Ok(Directions { rows, eigenvalues: values.iter().map(|s| s * s).collect() })
    }

    /// Returns the residual of each response along the directions of the common errors, and the remaining vector. A
    /// direction is read once for all responses, each of which has the same numbers as alone.
    pub fn split(&self, responses: &[&[f64]]) -> Vec<(Vec<f64>, Vec<f64>)> {
        let directions = &self.common.rows;
        let start = |response: &&[f64]| {
            let outputs = self.measured.iter().zip(&self.weight).zip(&self.weighted_mean);
            let outside = outputs.map(|((&i, w), mean)| mean - w * response[i]).collect();
            (Vec::with_capacity(directions.rows()), outside)
        };
        let mut all: Vec<(Vec<f64>, Vec<f64>)> = responses.iter().map(start).collect();
        for direction in directions.iter_rows() {
            for (along, outside) in &mut all {
                along.push(dot(direction, outside));
            }
        }
        for (k, direction) in directions.iter_rows().enumerate() {
            for (along, outside) in &mut all {
                let a = along[k];
                for (z, u) in outside.iter_mut().zip(direction) {
                    *z -= a * u;
                }
            }
        }
        all
    }
}
