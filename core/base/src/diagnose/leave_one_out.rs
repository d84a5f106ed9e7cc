//! Leave-one-out cross-validation of a posterior without refitting (PSIS-LOO).
//!
//! Pareto-smoothed importance sampling (Vehtari, Gelman and Gabry, Statistics and Computing 27 (2017) 1413). If the
//! data are dependent given the parameters, the density of a datum is conditional on all others (Bürkner, Gabry and
//! Vehtari, Computational Statistics 36 (2021) 1243). The part left out may be a whole curve, with the joint density of
//! its values.

mod sample;

use std::cmp::Ordering;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use self::sample::{Approximation, Sampled};
use super::pareto::{limit, smooth_dependent};
use crate::math::moments::{log_sum, mean};
use crate::matrix::Matrix;

/// Leave-one-out prediction of one datum or one curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Left {
    /// Log density under the posterior of all other data (one term of `elpd_loo`).
    pub elpd: f64,
    /// Log density under the posterior of all data, including this one.
    pub with_it: f64,
    /// Shape of the generalised Pareto law of the largest importance ratios; above [`limit`] the estimate is
    /// unreliable.
    pub k_hat: f64,
}

impl Left {
    /// The prediction from the log density of one datum, given the other data and the parameters, at each draw.
    ///
    /// `efficiency` is the ratio of independent to actual draws. The importance ratio of a draw is the reciprocal of
    /// its density.
    pub fn of(log_density: &[f64], efficiency: f64) -> Self {
        let ratios: Vec<f64> = log_density.iter().map(|l| -l).collect();
        let smoothed = smooth_dependent(&ratios, efficiency);
        let weighted = smoothed.log_weights.iter().zip(log_density).map(|(w, l)| w + l);
        Self {
            elpd: log_sum(weighted),
            with_it: log_sum(log_density.iter().copied()) - (log_density.len() as f64).ln(),
            k_hat: smoothed.k_hat,
        }
    }
}

/// Leave-one-out predictions of all data, or of all curves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeaveOneOut {
    /// Expected log pointwise predictive density `elpd_loo`: the sum over the parts left out.
    pub elpd: f64,
    /// Standard error of `elpd`, from the scatter over the parts left out as if they were independent.
    pub error: f64,
    /// Standard error of `elpd` from the scatter between curves, whose values may be dependent within a curve; `None`
    /// with fewer than two curves.
    pub error_by_curve: Option<f64>,
    /// Effective number of parameters `p_loo`: the log density with each datum included less `elpd_loo`, summed.
    pub parameters: f64,
    /// Number of parts with a `k_hat` above the limit, whose estimates are unreliable.
    pub unreliable: usize,
    /// Largest `k_hat` that the number of draws allows.
    pub limit: f64,
    /// One entry per datum, or per curve.
    pub data: Vec<Left>,
    /// Index of the curve each datum belongs to, counted from 0; empty if it is not known.
    pub curve: Vec<usize>,
    /// The sample that `data` are, if the sums over all data were estimated from one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampled: Option<Sampled>,
}

impl LeaveOneOut {
    /// The predictions from log densities of each datum given all others and the parameters, `draws x data`, with the
    /// [efficiency](Left::of) of the draws and the curve of each datum.
    pub fn of(log_density: &Matrix, efficiency: f64, curve: Vec<usize>) -> Self {
        let data = (0..log_density.columns()).into_par_iter();
        let left = data.map(|i| Left::of(&log_density.column(i), efficiency)).collect();
        Self::sum(left, limit(log_density.rows()), curve)
    }

    /// The predictions from data given one by one, for callers that cannot hold the matrix of log densities.
    pub fn sum(data: Vec<Left>, limit: f64, curve: Vec<usize>) -> Self {
        let elpd: Vec<f64> = data.iter().map(|left| left.elpd).collect();
        Self {
            elpd: elpd.iter().sum(),
            error: error_of_sum(&elpd),
            error_by_curve: error_by_curve(&elpd, &curve),
            parameters: data.iter().map(|left| left.with_it - left.elpd).sum(),
            unreliable: data
                .iter()
                .filter(|left| left.k_hat.is_nan() || left.k_hat > limit)
                .count(),
            limit,
            data,
            curve,
            sampled: None,
        }
    }
}

/// Probability of a value below the measured one under the prediction of each datum from all others (LOO-PIT).
///
/// `simulated` holds data simulated at the draws of `log_density` (`draws x data`); their weights are the smoothed
/// importance ratios of the datum that is left out. If the predictions are right the probabilities are uniform (Gelman,
/// Bayesian Data Analysis, 3rd edition, section 7.4; Säilynoja, Bürkner and Vehtari, Statistics and Computing 32 (2022)
/// 32). NaN for a datum without weights or simulated values.
pub fn probabilities_below(
    measured: &[f64],
    simulated: &Matrix,
    log_density: &Matrix,
    efficiency: f64,
) -> Vec<f64> {
    let one = |(i, measured): (usize, &f64)| {
        let ratios: Vec<f64> = log_density.column(i).iter().map(|l| -l).collect();
        let weights = smooth_dependent(&ratios, efficiency).log_weights;
        let below = |(weight, value): (&f64, f64)| match value.partial_cmp(measured) {
            Some(Ordering::Less) => weight.exp(),
            Some(Ordering::Equal) => 0.5 * weight.exp(),
            Some(Ordering::Greater) => 0.0,
            None => f64::NAN,
        };
        weights.iter().zip(simulated.column(i)).map(below).sum()
    };
    measured.par_iter().enumerate().map(one).collect()
}

/// Difference in predictive density between two models.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// `elpd` of the first model less that of the second.
    pub elpd: f64,
    /// Standard error of the difference, from the scatter of the pointwise differences.
    pub error: f64,
    /// Standard error of the difference from the scatter between curves; `None` if the curves are not known or fewer
    /// than two.
    pub error_by_curve: Option<f64>,
}

/// Compares the predictions of the same data by two models.
///
/// # Errors
/// If the numbers of data differ.
pub fn compare(a: &LeaveOneOut, b: &LeaveOneOut) -> Result<Difference, String> {
    if a.data.len() != b.data.len() {
        return Err(format!(
            "predictions of {} and of {} data cannot be compared: expected the same data",
            a.data.len(),
            b.data.len()
        ));
    }
    let differences: Vec<f64> = a.data.iter().zip(&b.data).map(|(a, b)| a.elpd - b.elpd).collect();
    if let (Some(own), Some(other)) = (&a.sampled, &b.sampled) {
        return sample::compare((a.elpd, own), (b.elpd, other), &differences);
    }
    let by_curve = error_by_curve(&differences, &a.curve).filter(|_| a.curve == b.curve);
    Ok(Difference {
        elpd: differences.iter().sum(),
        error: error_of_sum(&differences),
        error_by_curve: by_curve,
    })
}

/// `sqrt(n var)` with divisor `n`, as in the software of the paper.
fn error_of_sum(values: &[f64]) -> f64 {
    let centre = mean(values);
    values.iter().map(|x| (x - centre).powi(2)).sum::<f64>().sqrt()
}

/// Standard error of a sum over curves that are independent of each other, with arbitrary dependence within a curve.
///
/// With `C` curves of `n_c` values each it is `sqrt(C / (C - 1) sum_c (e_c - n_c m)^2)`, where `e_c` is the sum over a
/// curve and `m` the mean of all values (Liang and Zeger, Biometrika 73 (1986) 13, for a mean; Cameron and Miller, J.
/// Human Resources 50 (2015) 317, for the factor).
fn error_by_curve(values: &[f64], curve: &[usize]) -> Option<f64> {
    if curve.len() != values.len() {
        return None;
    }
    let centre = mean(values);
    let mut sums = vec![None; curve.iter().max().map_or(0, |last| last + 1)];
    for (value, &c) in values.iter().zip(curve) {
        *sums[c].get_or_insert(0.0) += value - centre;
    }
    let sums: Vec<f64> = sums.into_iter().flatten().collect();
    let count = sums.len() as f64;
    (sums.len() >= 2).then(|| {
        (count / (count - 1.0) * sums.iter().map(|sum: &f64| sum * sum).sum::<f64>()).sqrt()
    })
}

#[cfg(test)]
mod tests;
