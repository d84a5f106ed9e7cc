//! Coverage over many synthetic truths: what is drawn from a known law must lie in its intervals as often as they say.

#![allow(clippy::unwrap_used)]

use super::*;
use crate::data::{Axis, Layout, Replicate, Scenario, Unit};
use crate::math::random::{Stream, normal};

const OUTPUTS: usize = 120;
const PARAMETERS: usize = 2;
const REPLICATES: usize = 10;

/// A curve of an error: a random walk of smooth waves of more directions than there are samples.
fn error(stream: &Stream) -> Vec<f64> {
    let mut rng = stream.generator();
    let mut curve = vec![0.0; OUTPUTS];
    for k in 1..=60 {
        let [a, b] = [normal(&mut rng), normal(&mut rng)].map(|w| w / (f64::from(k) + 3.0));
        for (i, y) in curve.iter_mut().enumerate() {
            let phase = std::f64::consts::PI * f64::from(k) * i as f64 / OUTPUTS as f64;
            *y += a * phase.sin() + b * phase.cos();
        }
    }
    curve
}

fn slopes() -> Matrix {
    Matrix::from_fn(OUTPUTS, PARAMETERS, |i, j| {
        let t = i as f64 / OUTPUTS as f64;
        if j == 0 { 3.0 * (9.0 * t).sin() } else { 3.0 * (7.0 * t * t + 1.0).cos() }
    })
}

fn samples(stream: &Stream, count: usize) -> Sampled {
    let samples = Matrix::from_rows(OUTPUTS, (0..count).map(|k| error(&stream.at(k as u64))));
    let scale = (count as f64).sqrt();
    let factor = Matrix::from_fn(OUTPUTS, count, |i, k| samples[(k, i)] / scale);
    let error = CommonError { origin: "numerics".to_owned(), factor, predictive: true };
    Sampled { error, samples, noisy: false }
}

/// Replicates about the response zero plus one common error, with noise of standard deviation `sd`.
fn data(stream: &Stream, sd: f64) -> Measurements {
    let common = error(&stream.named("common"));
    let replicate = |r: usize| {
        let mut rng = stream.named("noise").at(r as u64).generator();
        let values = common.iter().map(|e| Some(e + sd * normal(&mut rng))).collect();
        Replicate { name: r.to_string(), scenario: Scenario::default(), values }
    };
    let unit = Unit::dimensionless();
    let grid = (0..OUTPUTS).map(|i| i as f64).collect();
    let axes = vec![Axis::grid("time", grid, unit.clone())];
    let layout = Layout { name: "y".into(), unit, axes };
    Measurements { layout, replicates: (0..REPLICATES).map(replicate).collect() }
}

/// The estimates of the parameters, which are zero, over their standard deviations.
fn scores(data: &Measurements, sd: f64, common: &[CommonError]) -> Vec<f64> {
    let slopes = slopes();
    let variance = sd * sd / REPLICATES as f64;
    let mut covariance = Matrix::zeros(OUTPUTS, OUTPUTS);
    for error in common {
        let square = linalg::multiply_transposed(&error.factor, &error.factor);
        let entries = covariance.as_mut_slice().iter_mut().zip(square.as_slice());
        entries.for_each(|(c, s)| *c += s);
    }
    (0..OUTPUTS).for_each(|i| covariance[(i, i)] += variance);
    let covariance = Cholesky::new(&covariance).unwrap();
    let white = covariance.whiten_matrix(&slopes);
    let mut mean: Vec<f64> = data.summaries().iter().map(|s| s.mean).collect();
    covariance.whiten(&mut mean);
    let mut information = linalg::gram(&white);
    (0..PARAMETERS).for_each(|j| information[(j, j)] += 1.0);
    let posterior = Cholesky::new(&information).unwrap();
    let mut estimate = linalg::transposed_multiply_vector(&white, &mean);
    posterior.solve(&mut estimate);
    let spread = posterior.inverse();
    (0..PARAMETERS).map(|j| estimate[j] / spread[(j, j)].sqrt()).collect()
}

/// The scores of many studies, each with its own thirty errors, data and truth; without and with what is missing.
fn studies(count: u64, sd: f64) -> [Vec<f64>; 2] {
    let fit = Fit { response: vec![0.0; OUTPUTS], slopes: slopes() };
    let mut all = [Vec::new(), Vec::new()];
    for k in 0..count {
        let stream = Stream::root(71).at(k);
        let (errors, data) = (samples(&stream.named("samples"), 30), data(&stream, sd));
        all[0].extend(scores(&data, sd, std::slice::from_ref(&errors.error)));
        all[1].extend(scores(&data, sd, &completed(vec![errors], &data, &fit).unwrap()));
    }
    all
}

fn covered(scores: &[f64], width: f64) -> f64 {
    scores.iter().filter(|z| z.abs() < width).count() as f64 / scores.len() as f64
}

fn mean_square(scores: &[f64]) -> f64 {
    scores.iter().map(|z| z * z).sum::<f64>() / scores.len() as f64
}

/// With noise far below the errors, thirty samples of an error of 120 directions leave intervals that are much too
/// narrow. Completed, they hold the truth at least as often as they say, less three binomial standard deviations,
/// and no more than twice as wide as need be.
#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    let [before, after] = studies(150, 0.02);
    for (width, nominal) in [(0.6745, 0.5), (1.6449, 0.9), (1.96, 0.95)] {
        let share = covered(&after, width);
        let bound = 3.0 * (nominal * (1.0 - nominal) / 150.0_f64).sqrt();
        println!("{nominal}: {} {share}", covered(&before, width));
        assert!(share > nominal - bound, "{share} of {nominal}");
    }
    println!("{} {}", mean_square(&before), mean_square(&after));
    assert!(mean_square(&before) > 2.0, "{}", mean_square(&before));
    assert!((0.5..1.5).contains(&mean_square(&after)), "{}", mean_square(&after));
}

/// Where the noise covers the errors nothing is missing, and next to nothing is added.
#[test]
fn little_is_added_where_the_noise_is_large() {
    let [before, after] = studies(150, 30.0);
    let (before, after) = (mean_square(&before), mean_square(&after));
    println!("{before} {after}");
    assert!((after - before).abs() < 0.05, "{before} {after}");
}

/// Data without noise say nothing of a metric: the errors stay as they are.
#[test]
fn exact_data_leave_the_errors_as_they_are() {
    let stream = Stream::root(5);
    let mut data = data(&stream, 0.0);
    data.replicates.truncate(1);
    let response: Vec<f64> = data.summaries().iter().map(|s| s.mean).collect();
    let errors = samples(&stream, 8);
    let fit = Fit { response, slopes: slopes() };
    let same = completed(vec![errors.clone()], &data, &fit).unwrap();
    assert_eq!(same, vec![errors.error]);
}
