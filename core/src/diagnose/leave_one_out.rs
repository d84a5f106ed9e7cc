//! How well a posterior predicts each datum from all others, without fitting anew.
//!
//! Pareto-smoothed importance sampling (Vehtari, Gelman and Gabry, Statistics and Computing 27 (2017) 1413).
//! Where the data depend on each other given the parameters, the density of a datum is the one
//! given all others (Bürkner, Gabry and Vehtari, Computational Statistics 36 (2021) 1243). What is left out may be a
//! whole curve, with the joint density of its values.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::pareto::{limit, smooth_dependent};
use crate::linalg::Matrix;
use crate::math::moments::{log_sum, mean};

/// The prediction of one datum, or of one curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Left {
    /// Its log density under the posterior of all others.
    pub elpd: f64,
    /// The same under the posterior of all data.
    pub with_it: f64,
    /// The shape of the tail of the importance ratios; above [`limit`] the estimate cannot be trusted.
    pub k_hat: f64,
}

impl Left {
    /// From its log density, given the other data and the parameters, at each draw; each draw is worth the share
    /// `efficiency` of an independent one.
    ///
    /// The draw's importance ratio is one over that density.
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

/// The prediction of all data, each from all others; or of all curves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeaveOneOut {
    /// The expected log predictive density: the sum over what is left out.
    pub elpd: f64,
    /// Its standard error, from the scatter over what is left out, as if each were independent of the others.
    pub error: f64,
    /// Its standard error from the scatter over the curves, whose values may depend on each other; `None` below two
    /// curves.
    pub error_by_curve: Option<f64>,
    /// The effective number of parameters: what knowing each datum itself adds.
    pub parameters: f64,
    /// How many have a shape above the limit, so that their estimates cannot be trusted.
    pub unreliable: usize,
    /// The largest shape that the number of draws allows.
    pub limit: f64,
    /// One entry a datum, or a curve.
    pub data: Vec<Left>,
    /// The curve that each datum belongs to, counted from 0; none where it is not known.
    pub curve: Vec<usize>,
}

impl LeaveOneOut {
    /// From log densities of each datum given all others and the parameters, `draws x data`, with the [efficiency](
    /// Left::of) of the draws and the curve of each datum.
    pub fn of(log_density: &Matrix, efficiency: f64, curve: Vec<usize>) -> Self {
        let data = (0..log_density.columns()).into_par_iter();
        let left = data.map(|i| Left::of(&log_density.column(i), efficiency)).collect();
        Self::sum(left, limit(log_density.rows()), curve)
    }

    /// From the data one by one, for those who cannot hold the matrix.
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
    /// Its standard error from the scatter of the differences of each curve; `None` where the curves are not known, or
    /// fewer than two.
    pub error_by_curve: Option<f64>,
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
    let by_curve = error_by_curve(&differences, &a.curve).filter(|_| a.curve == b.curve);
    Ok(Difference {
        elpd: differences.iter().sum(),
        error: error_of_sum(&differences),
        error_by_curve: by_curve,
    })
}

/// `sqrt(n var)` with divisor `n`, as in the paper's software.
fn error_of_sum(values: &[f64]) -> f64 {
    let centre = mean(values);
    values.iter().map(|x| (x - centre).powi(2)).sum::<f64>().sqrt()
}

/// The standard error of a sum over curves that are independent of each other, whatever their values do: with `C` curves
/// of `n_c` values each, `sqrt(C / (C - 1) sum_c (e_c - n_c m)^2)`, where `e_c` is the sum over a curve and `m` the mean of
/// all values (Liang and Zeger, Biometrika 73 (1986) 13, for a mean; Cameron and Miller, J. Human Resources 50 (2015) 317,
/// for the factor).
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
