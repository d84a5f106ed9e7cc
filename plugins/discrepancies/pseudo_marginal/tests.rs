//! The estimate against the closed form of a random effect.
#![allow(clippy::unwrap_used)]

use std::f64::consts::TAU;

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{Known, Likelihood};
use lacuna::plugin::{Discrepancy, registry};
use lacuna_linalg::Matrix;

use crate::discrepancies::common::testing::{OUTPUTS, data, has_its_derivatives};

/// Two replicates of two outputs, each of which has a random effect of its own.
const VALUES: [[f64; 2]; 2] = [[1.1, 0.4], [-0.3, 0.9]];
const MEAN: f64 = 0.5;
const EFFECT: f64 = 0.6;
const NOISE: f64 = 0.3;

fn build(text: &str, data: &Measurements) -> Box<dyn Likelihood> {
    let built = registry::from_text::<dyn Discrepancy>("pseudo_marginal", text).unwrap();
    built.plugin.likelihood(&Known::without_slopes(data, &[])).unwrap()
}

fn pairs() -> Measurements {
    let one = Unit::dimensionless;
    let layout =
        Layout { name: "y".into(), unit: one(), axes: vec![Axis::labels("part", ["A", "B"])] };
    let replicate = |(r, values): (usize, &[f64; 2])| {
        Replicate::new(r.to_string(), values.iter().copied().map(Some).collect())
    };
    Measurements::new(layout, VALUES.iter().enumerate().map(replicate).collect())
}

/// Responses `MEAN + EFFECT u` of both outputs.
fn responses(runs: usize, shared: bool, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).generator();
    let one = |_| {
        let first = normal(&mut rng);
        let second = if shared { first } else { normal(&mut rng) };
        [MEAN + EFFECT * first, MEAN + EFFECT * second]
    };
    Matrix::from_rows(2, (0..runs).map(one).collect::<Vec<_>>())
}

/// Log density of a pair of normal numbers about `MEAN` with variances `EFFECT² + NOISE²` and a covariance of `EFFECT²`,
/// or of zero.
fn closed_form(values: [f64; 2], shared: bool) -> f64 {
    let (own, with) = (EFFECT * EFFECT + NOISE * NOISE, if shared { EFFECT * EFFECT } else { 0.0 });
    let [a, b] = values.map(|y| y - MEAN);
    let determinant = own * own - with * with;
    let square = (own * (a * a + b * b) - 2.0 * with * a * b) / determinant;
    -0.5 * (square + determinant.ln()) - TAU.ln()
}

/// The mean of many estimates is the likelihood, within four of its standard errors: the estimate has no bias with three
/// runs either. One effect for both outputs, and one for each.
#[test]
fn the_estimate_has_no_bias() {
    const ESTIMATES: u64 = 20_000;
    for (shared, more) in [(true, ""), (false, "independent_by = \"part\"")] {
        let text = format!("simulations = 3\nvariance = {{ known = {} }}\n{more}", NOISE * NOISE);
        let likelihood = build(&text, &pairs());
        assert_eq!(likelihood.runs(), 6);
        let truth: f64 = VALUES.iter().map(|values| closed_form(*values, shared)).sum();
        let one = |seed| likelihood.log_estimate(&responses(6, shared, seed), &[]);
        let ratios: Vec<f64> = (0..ESTIMATES).map(|seed| (one(seed) - truth).exp()).collect();
        let n = ESTIMATES as f64;
        let mean = ratios.iter().sum::<f64>() / n;
        let variance = ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let error = (variance / n).sqrt();
        assert!((mean - 1.0).abs() < 4.0 * error && error < 0.02, "{shared}: {mean} +- {error}");
    }
}

/// The same runs for both replicates would not be independent; a run without a response counts as a density of zero.
#[test]
fn each_replicate_has_runs_of_its_own_and_a_failed_run_counts_as_zero() {
    let likelihood = build("simulations = 2\nvariance = { known = 0.09 }", &pairs());
    let runs = responses(4, true, 1);
    let whole = likelihood.log_estimate(&runs, &[]);
    let single = |rows: &[usize], replicate: usize| {
        let mut data = pairs();
        data.replicates = vec![data.replicates[replicate].clone()].into();
        let text = format!("simulations = {}\nvariance = {{ known = 0.09 }}", rows.len());
        build(&text, &data).log_estimate(&runs.select_rows(rows), &[])
    };
    assert!((whole - single(&[0, 1], 0) - single(&[2, 3], 1)).abs() < 1e-12);
    let mut failed = runs.clone();
    failed.row_mut(1).fill(f64::NAN);
    let half = single(&[0], 0) - 2.0_f64.ln() + single(&[2, 3], 1);
    assert!((likelihood.log_estimate(&failed, &[]) - half).abs() < 1e-12);
    failed.row_mut(0).fill(f64::NAN);
    assert_eq!(likelihood.log_estimate(&failed, &[]), f64::NEG_INFINITY);
}

#[test]
fn the_likelihood_of_one_response_has_its_derivatives() {
    let data = data(2, 3);
    let likelihood = build("variance = { half_normal = 1 }\nby = \"sensor\"", &data);
    let response: Vec<f64> = (0..OUTPUTS).map(|i| (i as f64).sin()).collect();
    let hyper: Vec<f64> = likelihood.hyperparameters().iter().map(|_| 0.6).collect();
    has_its_derivatives(&*likelihood, &response, &hyper);
}
