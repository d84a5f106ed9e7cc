//! Normal density of the replicates whose means share a bias with a dense covariance.
//!
//! The means have the covariance `V = K + F F' + diag(v / n)`: of the bias, of the common errors, and of the noise. The
//! scatter about the means depends on the noise alone.

use std::f64::consts::TAU;

use lacuna::data::Measurements;
use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Cholesky, Matrix, gram, multiply_vector};

use super::{Noise, Replicates, conditional, values};

/// Statistics of the data and the common errors (see the module).
#[derive(Debug, Clone)]
pub struct Dense {
    /// Counts, means and scatters of the measured outputs.
    pub replicates: Replicates,
    /// `F` at the measured outputs (`measured x rank`).
    pub factor: Matrix,
    /// Index of each output among the measured ones; `usize::MAX` for those never measured.
    pub place: Vec<usize>,
}

/// The density at one residual and one covariance.
pub struct DenseSolved {
    /// Log-likelihood.
    pub log_likelihood: f64,
    /// `V^-1 d` for the residual `d` of the means.
    pub pull: Vec<f64>,
    /// `V`, factored.
    pub cholesky: Cholesky,
}

impl Dense {
    /// Collects the statistics; `outputs` is the number of all outputs.
    pub fn new(replicates: Replicates, factor: Matrix, outputs: usize) -> Self {
        let mut place = vec![usize::MAX; outputs];
        replicates.measured.iter().enumerate().for_each(|(k, &i)| place[i] = k);
        Self { replicates, factor, place }
    }

    /// Computes the density for a residual of the means, the covariance of the bias, and the variance of the noise, all
    /// of the measured outputs; `None` if the covariance cannot be factored.
    pub fn solve(&self, bias: &Matrix, residual: &[f64], variance: &[f64]) -> Option<DenseSolved> {
        let r = &self.replicates;
        let n = residual.len();
        let mut covariance = bias.clone();
        for i in 0..n {
            for j in 0..=i {
                covariance[(i, j)] += dot(self.factor.row(i), self.factor.row(j));
            }
            covariance[(i, i)] += variance[i] / r.count[i];
        }
        let cholesky = Cholesky::new(&covariance).ok()?;
        let mut pull = residual.to_vec();
        cholesky.solve(&mut pull);
        let mut twice = cholesky.log_determinant() + dot(&pull, residual);
        for (i, v) in variance.iter().enumerate() {
            let n = r.count[i];
            twice += TAU.ln() + (n - 1.0) * (TAU * v).ln() + n.ln() + r.scatter[i] / v;
        }
        twice.is_finite().then_some(DenseSolved { log_likelihood: -0.5 * twice, pull, cholesky })
    }

    /// Adds the derivatives with respect to the variances of the noise to those with respect to the hyperparameters;
    /// `by_covariance` is the derivative of the log density of the means with respect to `V`.
    pub fn add_by_noise(
        &self,
        noise: &Noise,
        variance: &[f64],
        by_covariance: &Matrix,
        by_hyper: &mut [f64],
    ) {
        let r = &self.replicates;
        let one = |k: usize| {
            let (n, v) = (r.count[k], variance[k]);
            -0.5 * ((n - 1.0) / v - r.scatter[k] / (v * v)) + by_covariance[(k, k)] / n
        };
        let by_variance: Vec<f64> = (0..variance.len()).map(one).collect();
        noise.variance.add_gradient(&noise.by_group(r, &by_variance), by_hyper);
    }

    /// Returns the log density of each value given all others under the normal distribution, plus `correction(k, pull,
    /// precision)` for a value of the measured output `k` with this entry of the precision matrix times the residuals
    /// and this diagonal entry.
    pub fn left_out(
        &self,
        solved: &DenseSolved,
        data: &Measurements,
        variance: &[f64],
        correction: impl Fn(usize, f64, f64) -> f64,
    ) -> Vec<f64> {
        let inverse = solved.cholesky.inverse();
        let r = &self.replicates;
        let one = |(i, y): (usize, f64)| {
            let k = self.place[i];
            let (n, v) = (r.count[k], variance[k]);
            let pull = (y - r.mean[k]) / v + solved.pull[k] / n;
            let precision = (1.0 - 1.0 / n) / v + inverse[(k, k)] / (n * n);
            conditional(pull, precision) + correction(k, pull, precision)
        };
        values(data).map(one).collect()
    }
}

impl DenseSolved {
    /// Replaces mean and covariance of a normal vector by those given the data; `cross` is its covariance with the means
    /// of the measured outputs (`size x measured`).
    pub fn condition(&self, cross: &Matrix, mean: &mut [f64], covariance: &mut Matrix) {
        add_scaled(mean, 1.0, &multiply_vector(cross, &self.pull));
        let white = self.cholesky.whiten_matrix(&cross.transposed());
        let taken = gram(&white);
        let entries = covariance.as_mut_slice().iter_mut().zip(taken.as_slice());
        entries.for_each(|(c, t)| *c -= t);
    }

    /// Returns the derivative of the log density with respect to the covariance: `(V^-1 d d' V^-1 - V^-1) / 2`.
    pub fn by_covariance(&self) -> Matrix {
        let mut by = self.cholesky.inverse();
        let n = self.pull.len();
        for i in 0..n {
            for j in 0..n {
                by[(i, j)] = 0.5 * (self.pull[i] * self.pull[j] - by[(i, j)]);
            }
        }
        by
    }
}
