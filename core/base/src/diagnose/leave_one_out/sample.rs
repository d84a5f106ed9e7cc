//! Leave-one-out predictions of many data from a random sample of them.
//!
//! The difference estimator of Magnusson, Andersen, Jonasson and Vehtari (Leave-one-out cross-validation for Bayesian model
//! comparison in large data, AISTATS 2020, PMLR 108:341): an approximation of the prediction is summed over all data, and its
//! error is estimated from a sample drawn without replacement.

use serde::{Deserialize, Serialize};

use super::{Difference, LeaveOneOut, Left, error_of_sum};
use crate::math::moments::{mean, variance};

/// A sample from which sums over all data were estimated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sampled {
    /// Number of all data.
    pub of: usize,
    /// Standard error of `elpd` by the sampling alone.
    pub error: f64,
}

/// An approximation of the predictions of all data: the log density of each given all others at one point of the
/// parameters.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Approximation {
    /// Number of data.
    count: usize,
    sum: f64,
    squares: f64,
    /// Sum over the data of each curve, and their number.
    curves: Vec<(f64, f64)>,
    /// Values of the sample.
    sample: Vec<f64>,
}

impl Approximation {
    /// Adds the next datum; `is_first` begins another curve, and `is_sampled` tells that the datum is in the sample.
    pub fn add(&mut self, log_density: f64, is_first: bool, is_sampled: bool) {
        self.count += 1;
        self.sum += log_density;
        self.squares += log_density * log_density;
        if is_first || self.curves.is_empty() {
            self.curves.push((0.0, 0.0));
        }
        if let Some((sum, count)) = self.curves.last_mut() {
            *sum += log_density;
            *count += 1.0;
        }
        if is_sampled {
            self.sample.push(log_density);
        }
    }

    /// Standard error of the sum from the scatter between curves, as for all data; `None` with fewer than two.
    fn error_by_curve(&self) -> Option<f64> {
        let centre = self.sum / self.count as f64;
        let curves = self.curves.len() as f64;
        let squares: f64 = self.curves.iter().map(|(sum, n)| (sum - n * centre).powi(2)).sum();
        (curves >= 2.0).then(|| (curves / (curves - 1.0) * squares).sqrt())
    }
}

impl LeaveOneOut {
    /// The predictions of all data from those of a sample, in the order of the approximation.
    ///
    /// The errors contain that by the sampling, and the unreliable data are those of the sample.
    pub fn from_sample(sample: Vec<Left>, whole: &Approximation, limit: f64) -> Self {
        let found = Self::sum(sample, limit, Vec::new());
        let all = whole.count as f64;
        let each = || found.data.iter().zip(&whole.sample);
        let corrections: Vec<f64> = each().map(|(left, about)| left.elpd - about).collect();
        let squares: Vec<f64> =
            each().map(|(left, about)| left.elpd * left.elpd - about * about).collect();
        let elpd = whole.sum + all * mean(&corrections);
        let error = sampling_error(&corrections, all);
        let scatter = whole.squares + all * mean(&squares) - elpd * elpd / all;
        let parameters = found.parameters / found.data.len() as f64 * all;
        Self {
            elpd,
            error: scatter.max(0.0).sqrt().hypot(error),
            error_by_curve: whole.error_by_curve().map(|between| between.hypot(error)),
            parameters,
            sampled: Some(Sampled { of: whole.count, error }),
            ..found
        }
    }
}

/// Standard error of `all` times the mean of a sample without replacement from `all` values.
fn sampling_error(sample: &[f64], all: f64) -> f64 {
    let count = sample.len() as f64;
    all * ((1.0 - count / all).max(0.0) * variance(sample) / count).sqrt()
}

/// Compares two models by samples of the same data. The scatter over all data is that of the sample; the errors by the
/// sampling are added as if they were independent, although those of one sample partly cancel.
pub(super) fn compare(
    (a, own): (f64, &Sampled),
    (b, other): (f64, &Sampled),
    differences: &[f64],
) -> Result<Difference, String> {
    if own.of != other.of {
        let (own, other) = (own.of, other.of);
        return Err(format!(
            "predictions of {own} and of {other} data cannot be compared: expected the same data"
        ));
    }
    let scale = (own.of as f64 / differences.len() as f64).sqrt();
    let scatter = error_of_sum(differences) * scale;
    let error = scatter.hypot(own.error).hypot(other.error);
    Ok(Difference { elpd: a - b, error, error_by_curve: None })
}
