//! The likelihood against the multivariate normal density written out, and the process against its
//! covariance.
#![allow(clippy::unwrap_used)]

use lacuna::math::random::Stream;
use lacuna::plugin::Discrepancy;
use lacuna::plugin::discrepancy::{Known, Likelihood};

use super::Autoregressive;
use crate::discrepancies::common::testing::{
    OUTPUTS, TIMES, Written, close, common, data, has_its_derivatives, layout, options,
    random_matrix, shared,
};

fn build(text: &str, known: &Known<'_>) -> Box<dyn Likelihood> {
    let chosen: Autoregressive = options("autoregressive", text).unwrap();
    chosen.likelihood(known).unwrap()
}

const OPTIONS: &str = "variance = { half_normal = 1 }\nby = [\"sensor\", { axis = \"time\", windows = 2 }]\n\
    correlation_time = { half_normal = 1 }\ncorrelation_by = \"sensor\"";

fn time(i: usize) -> f64 {
    let j = (i % TIMES) as f64;
    1e-4 * (j + 0.1 * j * j)
}

/// The covariance within a replicate: `sqrt(v v') exp(-|t - t'| / tau)` within a sensor.
fn own(v: &dyn Fn(usize) -> f64, tau: &dyn Fn(usize) -> f64, i: usize, j: usize) -> f64 {
    if i / TIMES != j / TIMES {
        return 0.0;
    }
    (v(i) * v(j)).sqrt() * (-(time(i) - time(j)).abs() / tau(i / TIMES)).exp()
}

#[test]
fn it_is_the_normal_density_written_out() {
    let hyper = [0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 5e-5, 2e-4, 1e-3];
    let v = |i: usize| hyper[2 * (i / TIMES) + i % TIMES * 2 / TIMES];
    let tau = |s: usize| hyper[6 + s];
    for seed in 0..5 {
        let (data, error) = (data(seed, 4), [common(seed + 1)]);
        let response = random_matrix(1, OUTPUTS, seed + 2);
        for error in [&[][..], &error[..]] {
            let likelihood = build(OPTIONS, &Known::without_slopes(&data, error));
            assert_eq!(likelihood.hyperparameters()[7].name, "correlation_time[C]");
            let written =
                Written::new(&data, response.row(0), shared(error), |i, j| own(&v, &tau, i, j));
            close(likelihood.log_likelihood(response.row(0), &hyper), written.log_density(), 1e-10);
            let left_out = likelihood.left_out(response.row(0), &hyper).unwrap();
            left_out.iter().zip(written.left_out()).for_each(|(f, e)| close(*f, e, 1e-9));
        }
    }
}

/// Times are in units of 1e-4 s, so that one difference step suits all hyperparameters.
#[test]
fn gradients_are_the_derivatives() {
    let (mut data, error) = (data(3, 4), [common(4)]);
    let grid: Vec<f64> = (0..TIMES).map(|j| 1e4 * time(j)).collect();
    data.layout.axes[1] = lacuna::data::Axis::grid("time", grid, layout().unit);
    let response = random_matrix(1, OUTPUTS, 5);
    let hyper = [0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 0.5, 2.0, 10.0];
    for error in [&[][..], &error[..]] {
        let likelihood = build(OPTIONS, &Known::without_slopes(&data, error));
        has_its_derivatives(&*likelihood, response.row(0), &hyper);
    }
}

/// Noise at the outputs of the second series in 4000 draws has the stationary covariance of variance 2 and correlation time
/// 1e-4. A sample covariance has the standard error `v sqrt((1 + rho^2) / n)`.
fn has_the_stationary_covariance(draw: impl Fn(&Stream) -> Vec<f64>) {
    let count = 4000;
    let mut sums = [[0.0; TIMES]; TIMES];
    for k in 0..count {
        let noise = draw(&Stream::root(3).at(k));
        let y = |j: usize| noise[TIMES + j];
        for (i, row) in sums.iter_mut().enumerate() {
            row.iter_mut().enumerate().for_each(|(j, s)| *s += y(i) * y(j));
        }
    }
    for (i, row) in sums.iter().enumerate() {
        for (j, sum) in row.iter().enumerate() {
            let rho = (-(time(i) - time(j)).abs() / 1e-4).exp();
            let bound = 4.5 * 2.0 * ((1.0 + rho * rho) / count as f64).sqrt();
            assert!((sum / count as f64 - 2.0 * rho).abs() < bound, "{i} {j}");
        }
    }
}

const STATED: &str = "variance = { known = 2.0 }\ncorrelation_time = { known = 1e-4 }";

#[test]
fn simulated_noise_has_the_stationary_covariance() {
    let data = data(1, 1);
    let likelihood = build(STATED, &Known::without_slopes(&data, &[]));
    has_the_stationary_covariance(|stream| {
        let made = likelihood.simulate(&[0.0; OUTPUTS], &[], stream);
        made[0].replicates[0].values.iter().map(|value| value.unwrap_or(f64::NAN)).collect()
    });
}

/// With replicates the noise has two parts, whose sum is the process.
#[test]
fn drawn_errors_have_the_stationary_covariance() {
    for replicates in [1, 4] {
        let data = data(1, replicates);
        let likelihood = build(STATED, &Known::without_slopes(&data, &[]));
        let count = if replicates == 1 { 1 } else { 2 };
        has_the_stationary_covariance(|stream| {
            let paths = likelihood.errors(&[0.0; OUTPUTS], &[], stream);
            assert_eq!(paths.len(), count);
            (0..OUTPUTS).map(|i| paths.iter().map(|path| path.values[i]).sum()).collect()
        });
    }
}
