//! The scaled process against its definition, the formula of its authors' scripts, and the process without scaling.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Measurements, Unit};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{Known, Likelihood};
use lacuna::plugin::{Discrepancy, registry};
use lacuna_linalg::{Cholesky, Matrix};

use super::bias::ScaledBias;
use super::{Biased, ScaledGaussianProcess};
use crate::discrepancies::common::testing::{
    OUTPUTS, TIMES, Written, close, common, data, has_its_derivatives, options, random_matrix,
    shared,
};
use crate::discrepancies::common::{Bias, Correlation, Functional};

fn build(text: &str, data: &Measurements) -> Biased<ScaledBias> {
    let chosen: ScaledGaussianProcess = options("scaled_gaussian_process", text).unwrap();
    chosen.under(&Known::without_slopes(data, &[common(5)]), data).unwrap()
}

const SIZES: &str = "bias = { half_normal = 1 }\ncorrelation_length = { half_normal = 1 }\n\
    variance = { half_normal = 1 }\n";

/// Times in units of 1e-4 s.
fn rescaled(seed: u64) -> Measurements {
    let mut data = data(seed, 4);
    let grid = (0..TIMES).map(|j| j as f64 + 0.1 * (j * j) as f64).collect();
    data.layout.axes[1] = Axis::grid("time", grid, Unit::dimensionless());
    data
}

/// The covariance as `s² (R^-1 + λ/n I)^-1`, as the scripts of Gu, Xie and Wang (2022) write it.
#[test]
fn it_is_the_normal_density_written_out() {
    let data = rescaled(2);
    let likelihood = build(&format!("{SIZES}scaling = {{ half_normal = 100 }}"), &data);
    let response = random_matrix(1, OUTPUTS, 3);
    let (sd, length, scaling, noise) = (0.8_f64, 1.7, 12.0, 0.3);
    let series = |s: usize| {
        let kept: Vec<usize> =
            (s * TIMES..(s + 1) * TIMES).filter(|&i| !data.values(i).is_empty()).collect();
        let at = |i: usize| {
            let j = (kept[i] % TIMES) as f64;
            Functional::value(j + 0.1 * j * j)
        };
        let n = kept.len();
        let r = Matrix::from_fn(n, n, |i, j| {
            Correlation::FiveHalves.covariance(&at(i), &at(j), length).0
        });
        let mut inverse = Cholesky::new(&r).unwrap().inverse();
        (0..n).for_each(|i| inverse[(i, i)] += scaling / n as f64);
        (kept, Cholesky::new(&inverse).unwrap().inverse())
    };
    let all: Vec<(Vec<usize>, Matrix)> = (0..3).map(series).collect();
    let error = [common(5)];
    let of_error = shared(&error);
    let both = |i: usize, j: usize| {
        let (kept, own) = &all[i / TIMES];
        let place = |i: usize| kept.iter().position(|&k| k == i);
        let of_bias = match (place(i), place(j)) {
            (Some(a), Some(b)) => sd * sd * own[(a, b)],
            _ => 0.0,
        };
        of_error(i, j) + of_bias
    };
    let written =
        Written::new(&data, response.row(0), both, |i, j| if i == j { noise } else { 0.0 });
    let hyper = [sd, length, scaling, noise];
    close(likelihood.log_likelihood(response.row(0), &hyper), written.log_density(), 1e-9);
    let left_out = likelihood.left_out(response.row(0), &hyper).unwrap();
    left_out.iter().zip(written.left_out()).for_each(|(f, e)| close(*f, e, 1e-8));
    has_its_derivatives(&likelihood, response.row(0), &hyper);
    let root = build(&format!("{SIZES}bias_by = \"sensor\"\nkernel = \"matern_3_2\""), &data);
    let hyper = [0.8, 0.5, 0.2, 1.5, 0.7, 3.0, 0.3];
    has_its_derivatives(&root, response.row(0), &hyper);
    // What is predicted at the measured outputs is their prior.
    let told = root.bias.variance(&hyper).unwrap();
    let prior = root.bias.covariance(&hyper).unwrap();
    for (k, &i) in root.dense.replicates.measured.iter().enumerate() {
        close(told[i], prior[(k, k)], 1e-9);
    }
}

/// The definition: draws of a Gaussian process weighted with `exp(-λ Z / (2 s²))`, `Z` their mean square.
#[test]
fn it_weights_a_process_by_its_mean_square() {
    const DRAWS: u64 = 40_000;
    let mut data = rescaled(1);
    data.layout.axes.remove(0);
    for replicate in &mut data.replicates {
        replicate.values = (0..TIMES).map(|i| Some((i as f64).sin())).collect();
    }
    let text = "bias = { known = 0.7 }\ncorrelation_length = { known = 2.0 }\n\
        scaling = { known = 6.0 }\nvariance = { known = 1 }";
    let chosen: ScaledGaussianProcess = options("scaled_gaussian_process", text).unwrap();
    let likelihood = chosen.under(&Known::without_slopes(&data, &[]), &data).unwrap();
    let found = likelihood.bias.covariance(&[]).unwrap();
    let at = |i: usize| Functional::value(i as f64 + 0.1 * (i * i) as f64);
    let plain = Matrix::from_fn(TIMES, TIMES, |i, j| {
        0.49 * Correlation::FiveHalves.covariance(&at(i), &at(j), 2.0).0
    });
    let root = Cholesky::new(&plain).unwrap();
    let (mut total, mut squares, mut sums) = (0.0, 0.0, Matrix::zeros(TIMES, TIMES));
    for k in 0..DRAWS {
        let mut rng = Stream::root(4).at(k).generator();
        let z: Vec<f64> = (0..TIMES).map(|_| normal(&mut rng)).collect();
        let bias = root.colour(&z);
        let mean_square = bias.iter().map(|b| b * b).sum::<f64>() / TIMES as f64;
        let weight = (-6.0 * mean_square / (2.0 * 0.49)).exp();
        total += weight;
        squares += weight * weight;
        for i in 0..TIMES {
            (0..TIMES).for_each(|j| sums[(i, j)] += weight * bias[i] * bias[j]);
        }
    }
    let effective = total * total / squares;
    for i in 0..TIMES {
        for j in 0..TIMES {
            let spread = (found[(i, i)] * found[(j, j)] + found[(i, j)].powi(2)).sqrt();
            let error = (sums[(i, j)] / total - found[(i, j)]).abs();
            assert!(error < 4.0 * spread / effective.sqrt(), "{i} {j}: {error} {spread}");
        }
    }
}

/// Without scaling it is the discrepancy `gaussian_process`.
#[test]
fn without_scaling_it_is_the_gaussian_process() {
    let (data, response) = (rescaled(4), random_matrix(1, OUTPUTS, 5));
    let scaled = build(&format!("{SIZES}scaling = {{ known = 1e-9 }}"), &data);
    let plain = registry::from_text::<dyn Discrepancy>(
        "gaussian_process",
        &format!("{SIZES}orthogonal = false"),
    );
    let errors = [common(5)];
    let plain = plain.unwrap().plugin.likelihood(&Known::without_slopes(&data, &errors)).unwrap();
    let hyper = [0.8, 1.7, 0.3];
    let expected = plain.log_likelihood(response.row(0), &hyper);
    close(scaled.log_likelihood(response.row(0), &hyper), expected, 1e-7);
}
