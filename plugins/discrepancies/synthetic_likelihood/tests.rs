//! The estimate against the normal density that it estimates.
#![allow(clippy::unwrap_used)]

use std::f64::consts::TAU;

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{Known, Likelihood};
use lacuna::plugin::{Discrepancy, registry};
use lacuna_linalg::Matrix;

use crate::discrepancies::common::testing::{OUTPUTS, data, has_its_derivatives};

fn build(text: &str, data: &Measurements) -> Box<dyn Likelihood> {
    let built = registry::from_text::<dyn Discrepancy>("synthetic_likelihood", text).unwrap();
    built.plugin.likelihood(&Known::without_slopes(data, &[])).unwrap()
}

fn pair(values: [f64; 2]) -> Measurements {
    let one = Unit::dimensionless;
    let axes = vec![Axis::labels("statistic", ["A", "B"])];
    let layout = Layout { name: "s".into(), unit: one(), axes };
    Measurements::new(layout, vec![Replicate::new("1", values.map(Some).to_vec())])
}

/// Runs with the mean (1, 2), variances of 0.25 and 1, and a correlation of 0.6.
fn runs(count: usize, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).generator();
    let one = |_| {
        let (a, b) = (normal(&mut rng), normal(&mut rng));
        [1.0 + 0.5 * a, 2.0 + 0.6 * a + 0.8 * b]
    };
    Matrix::from_rows(2, (0..count).map(one).collect::<Vec<_>>())
}

/// Log density of that distribution with this variance added to both statistics.
fn exact([a, b]: [f64; 2], added: f64) -> f64 {
    let (first, second, with) = (0.25 + added, 1.0 + added, 0.3);
    let (x, y) = (a - 1.0, b - 2.0);
    let determinant = first * second - with * with;
    let square = (second * x * x - 2.0 * with * x * y + first * y * y) / determinant;
    -TAU.ln() - 0.5 * (determinant.ln() + square)
}

/// The mean of many estimates from few normal runs is the density within four standard errors, with and without noise that is
/// added to the runs; the estimate that inserts mean and covariance has a bias of many standard errors.
#[test]
fn the_estimate_has_no_bias_for_normal_statistics() {
    const ESTIMATES: u64 = 20_000;
    let values = [0.6, 2.9];
    let ratio = |text: &str, added: f64| {
        let likelihood = build(text, &pair(values));
        let one =
            |seed| (likelihood.log_estimate(&runs(8, seed), &[]) - exact(values, added)).exp();
        let ratios: Vec<f64> = (0..ESTIMATES).map(one).collect();
        let mean = ratios.iter().sum::<f64>() / ESTIMATES as f64;
        let variance = ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>();
        (mean, (variance / (ESTIMATES as f64).powi(2)).sqrt())
    };
    for (text, added) in
        [("simulations = 8", 0.0), ("simulations = 8\nvariance = { known = 0.2 }", 0.2)]
    {
        let (mean, error) = ratio(text, added);
        assert!((mean - 1.0).abs() < 4.0 * error && error < 0.02, "{text}: {mean} +- {error}");
    }
    let (mean, error) = ratio("simulations = 8\nestimator = \"plug_in\"", 0.0);
    assert!((mean - 1.0).abs() > 8.0 * error, "{mean} +- {error}");
}

/// With many runs both estimates are the density, to their Monte Carlo error.
#[test]
fn both_estimates_converge_to_the_density() {
    let values = [0.6, 2.9];
    for estimator in ["unbiased", "plug_in"] {
        let text = format!("simulations = 40000\nestimator = \"{estimator}\"");
        let found = build(&text, &pair(values)).log_estimate(&runs(40_000, 3), &[]);
        // The score of the density by mean and covariance is of order one.
        assert!((found - exact(values, 0.0)).abs() < 4.0 * 2.0 / 200.0, "{estimator} {found}");
    }
}

#[test]
fn a_run_without_a_response_or_without_scatter_has_no_density() {
    let likelihood = build("simulations = 8", &pair([0.6, 2.9]));
    let mut some = runs(8, 1);
    some.row_mut(3).fill(f64::NAN);
    assert_eq!(likelihood.log_estimate(&some, &[]), f64::NEG_INFINITY);
    let equal = Matrix::from_fn(8, 2, |_, j| 1.0 + j as f64);
    assert_eq!(likelihood.log_estimate(&equal, &[]), f64::NEG_INFINITY);
}

#[test]
fn the_likelihood_of_one_response_has_its_derivatives() {
    let data = data(2, 3);
    let text = "simulations = 100\nvariance = { half_normal = 1 }\nby = \"sensor\"";
    let likelihood = build(text, &data);
    let response: Vec<f64> = (0..OUTPUTS).map(|i| (i as f64).sin()).collect();
    let hyper: Vec<f64> = likelihood.hyperparameters().iter().map(|_| 0.6).collect();
    has_its_derivatives(&*likelihood, &response, &hyper);
}
