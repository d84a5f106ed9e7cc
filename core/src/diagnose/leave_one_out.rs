//! How well a posterior predicts each datum from all others, without fitting anew.
//!
//! Pareto-smoothed importance sampling (Vehtari, Gelman and Gabry, Statistics and Computing 27 (2017) 1413).
//! Where the data depend on each other given the parameters, the density of a datum is the one
//! given all others (Bürkner, Gabry and Vehtari, Computational Statistics 36 (2021) 1243).

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::pareto::{LARGEST_K, smooth};
use crate::linalg::Matrix;
use crate::math::moments::{log_sum, mean};

/// The prediction of one datum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Left {
    /// The log density of the datum under the posterior of all others.
    pub elpd: f64,
    /// The same under the posterior of all data.
    pub with_it: f64,
    /// The shape of the tail of the importance ratios; above 0.7 the estimate cannot be trusted.
    pub k_hat: f64,
}

impl Left {
    /// From the log density of the datum, given the other data and the parameters, at each draw.
    ///
    /// The draw's importance ratio is one over that density.
    pub fn of(log_density: &[f64]) -> Self {
        let ratios: Vec<f64> = log_density.iter().map(|l| -l).collect();
        let smoothed = smooth(&ratios);
        let weighted = smoothed.log_weights.iter().zip(log_density).map(|(w, l)| w + l);
        Self {
            elpd: log_sum(weighted),
            with_it: log_sum(log_density.iter().copied()) - (log_density.len() as f64).ln(),
            k_hat: smoothed.k_hat,
        }
    }
}

/// The prediction of all data, each from all others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeaveOneOut {
    /// The expected log pointwise predictive density: the sum over the data.
    pub elpd: f64,
    /// Its standard error, from the scatter over the data.
    pub error: f64,
    /// The effective number of parameters: what knowing each datum itself adds.
    pub parameters: f64,
    /// How many data have a shape above 0.7, so that their estimates cannot be trusted.
    pub unreliable: usize,
    /// One entry a datum.
    pub data: Vec<Left>,
}

impl LeaveOneOut {
    /// From log densities of each datum given all others and the parameters, `draws x data`.
    pub fn of(log_density: &Matrix) -> Self {
        let data = (0..log_density.columns()).into_par_iter();
        Self::sum(data.map(|i| Left::of(&log_density.column(i))).collect())
    }

    /// From the data one by one, for those who cannot hold the matrix.
    pub fn sum(data: Vec<Left>) -> Self {
        let elpd: Vec<f64> = data.iter().map(|left| left.elpd).collect();
        Self {
            elpd: elpd.iter().sum(),
            error: error_of_sum(&elpd),
            parameters: data.iter().map(|left| left.with_it - left.elpd).sum(),
            unreliable: data.iter().filter(|left| left.k_hat > LARGEST_K).count(),
            data,
        }
    }
}

/// By how much one model predicts better than another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// The first's expected log density less the second's.
    pub elpd: f64,
    /// Its standard error, from the scatter of the differences of each datum.
    pub error: f64,
}

/// Compares the predictions of the same data by two models; an error where the data differ in number.
pub fn compare(a: &LeaveOneOut, b: &LeaveOneOut) -> Result<Difference, String> {
    if a.data.len() != b.data.len() {
        return Err(format!(
            "predictions of {} and of {} data cannot be compared: expected the same data",
            a.data.len(),
            b.data.len()
        ));
    }
    let differences: Vec<f64> = a.data.iter().zip(&b.data).map(|(a, b)| a.elpd - b.elpd).collect();
    Ok(Difference { elpd: differences.iter().sum(), error: error_of_sum(&differences) })
}

/// `sqrt(n var)` with divisor `n`, as in the paper's software.
fn error_of_sum(values: &[f64]) -> f64 {
    let centre = mean(values);
    values.iter().map(|x| (x - centre).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests;
