//! Normal density of replicates, with a variance for each output and errors common to all replicates.
//!
//! With `n_i` replicates of output `i`, their mean `ybar_i` and scatter `S_i`, the response `m` and the common errors
//! `F zeta`, `zeta` standard normal,
//!
//! ```text
//! log L = -1/2 [ sum_i (n_i log(2 pi v_i) + (S_i + n_i e_i^2) / v_i) + |zeta|^2 + log det C ]
//! ```
//!
//! at the `zeta` that minimises the bracket, with `e = ybar - m - F zeta` and `C = I + F' N V^-1 F` (Woodbury's
//! identity; Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), A.3). Written as a sum of
//! squares it has no cancellation.
//!
//! Derivatives follow from Fisher's identity: those of the joint density of data and `zeta`, averaged over `zeta`
//! given the data, whose mean is the minimiser above and whose covariance is `C^-1`.

use std::f64::consts::TAU;

use lacuna::plugin::discrepancy::CommonError;
use lacuna::run::Stop;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix};

use super::Replicates;

/// Statistics of the data and the common errors (see the module).
#[derive(Debug, Clone)]
pub struct Normal {
    /// Counts, means and scatters of the measured outputs.
    pub replicates: Replicates,
    /// `F` at the measured outputs (`measured x rank`).
    pub factor: Matrix,
}

/// Log-likelihood and derivatives at one response and one set of variances.
pub struct Solved {
    /// Log-likelihood.
    pub log_likelihood: f64,
    /// `e` for each measured output.
    pub error: Vec<f64>,
    capacitance: Cholesky,
}

impl Normal {
    /// Collects the statistics of the replicates and the common errors.
    pub fn new(replicates: &Replicates, common: &[CommonError]) -> Result<Self, Stop> {
        Ok(Self { factor: replicates.common_factor(common)?, replicates: replicates.clone() })
    }

    /// Computes the density of the data about a response, given the variance of each measured output; `None` if the
    /// matrix `C` cannot be factored.
    pub fn solve(&self, response: &[f64], variance: &[f64]) -> Option<Solved> {
        let r = &self.replicates;
        let mut error = r.residual(response);
        let rank = self.factor.columns();
        let root: Vec<f64> = r.count.iter().zip(variance).map(|(n, v)| (n / v).sqrt()).collect();
        let scaled = Matrix::from_fn(error.len(), rank, |i, k| root[i] * self.factor[(i, k)]);
        let mut capacitance = lacuna_linalg::gram(&scaled);
        for k in 0..rank {
            capacitance[(k, k)] += 1.0;
        }
        let capacitance = Cholesky::new(&capacitance).ok()?;
        let white: Vec<f64> = error.iter().zip(&root).map(|(e, w)| e * w).collect();
        let mut zeta = lacuna_linalg::transposed_multiply_vector(&scaled, &white);
        capacitance.solve(&mut zeta);
        for (e, row) in error.iter_mut().zip(self.factor.iter_rows()) {
            *e -= dot(row, &zeta);
        }
        let mut twice = dot(&zeta, &zeta) + capacitance.log_determinant();
        for i in 0..error.len() {
            let (n, v) = (r.count[i], variance[i]);
            twice += n * (TAU * v).ln() + (r.scatter[i] + n * error[i] * error[i]) / v;
        }
        Some(Solved { log_likelihood: -0.5 * twice, error, capacitance })
    }

    /// Returns `f_i' C^-1 f_i`, the variance of the common error of each measured output given the data.
    pub fn spread(&self, solved: &Solved) -> Vec<f64> {
        if self.factor.columns() == 0 {
            return vec![0.0; self.factor.rows()];
        }
        let white = solved.capacitance.whiten_matrix(&self.factor.transposed());
        let mut spread = vec![0.0; self.factor.rows()];
        for row in white.iter_rows() {
            spread.iter_mut().zip(row).for_each(|(s, w)| *s += w * w);
        }
        spread
    }

    /// Returns the derivatives with respect to the response at the measured outputs, at fixed variances.
    pub fn by_response(&self, solved: &Solved, variance: &[f64]) -> Vec<f64> {
        let outputs = self.replicates.count.iter().zip(&solved.error).zip(variance);
        outputs.map(|((n, e), v)| n * e / v).collect()
    }

    /// Returns the derivatives with respect to the variance of each measured output.
    pub fn by_variance(&self, solved: &Solved, variance: &[f64]) -> Vec<f64> {
        let r = &self.replicates;
        let spread = self.spread(solved);
        let one = |i: usize| {
            let (n, v) = (r.count[i], variance[i]);
            let squares = r.scatter[i] + n * (solved.error[i].powi(2) + spread[i]);
            -0.5 * (n / v - squares / (v * v))
        };
        (0..variance.len()).map(one).collect()
    }

    /// Returns the log density of each value given all others, from the precision matrix of all data.
    pub fn left_out(
        &self,
        solved: &Solved,
        data: &lacuna::data::Measurements,
        response: &[f64],
        variance: &[f64],
    ) -> Vec<f64> {
        let r = &self.replicates;
        let spread = self.spread(solved);
        let residual = r.residual(response);
        let mut place = vec![usize::MAX; response.len()];
        r.measured.iter().enumerate().for_each(|(k, &i)| place[i] = k);
        let one = |(i, y): (usize, f64)| {
            let k = place[i];
            let v = variance[k];
            let common = residual[k] - solved.error[k];
            let pull = (y - response[i] - common) / v;
            let precision = (1.0 - spread[k] / v) / v;
            conditional(pull, precision)
        };
        values(data).map(one).collect()
    }
}

/// Iterates over all measured values with their outputs, replicate by replicate.
pub fn values(data: &lacuna::data::Measurements) -> impl Iterator<Item = (usize, f64)> {
    data.replicates.iter().flat_map(|replicate| {
        replicate.values.iter().enumerate().filter_map(|(i, y)| Some((i, (*y)?)))
    })
}

/// Returns the log density of a value given all others. `pull` is its entry of the precision matrix times the
/// residuals, `precision` the diagonal entry (Bürkner, Gabry and Vehtari 2021, equation 8).
pub fn conditional(pull: f64, precision: f64) -> f64 {
    0.5 * ((precision / TAU).ln() - pull * pull / precision)
}
