//! The likelihood against the dense multivariate normal density, and its parts against each other.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, Known, Likelihood};
use lacuna::plugin::forward::Linear;
use lacuna_linalg::{Cholesky, Matrix};

use super::Gaussian;
use super::likelihood::GaussianLikelihood;
use crate::discrepancies::common::testing::options;

mod groups;
mod smooth;
mod stated;

const OUTPUTS: usize = 7;
const TERMS: usize = 3;

struct Emulated {
    coefficients: Matrix,
}

impl Linear for Emulated {
    fn coefficients(&self) -> &Matrix {
        &self.coefficients
    }
    fn basis(&self, points: &Matrix) -> Matrix {
        points.clone()
    }
    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        Matrix::from_fn(point.len(), point.len(), |i, j| f64::from(u8::from(i == j)))
    }
}

/// Random data with unequal replicates and missing values.
fn data(seed: u64) -> Measurements {
    let mut rng = Stream::root(seed).generator();
    let replicate = |r: usize, rng: &mut _| {
        Replicate::new(
            r.to_string(),
            (0..OUTPUTS)
                .map(|i| {
                    let y = normal(rng) + i as f64;
                    (i != 4 && (r == 0 || uniform(rng) < 0.6)).then_some(y)
                })
                .collect(),
        )
    };
    let grid = (0..OUTPUTS).map(|i| i as f64).collect();
    Measurements::new(
        Layout {
            name: "y".into(),
            unit: Unit::parse("m").unwrap(),
            axes: vec![Axis::grid("time", grid, Unit::parse("s").unwrap())],
        },
        (0..5).map(|r| replicate(r, &mut rng)).collect(),
    )
}

fn random_matrix(rows: usize, columns: usize, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).generator();
    Matrix::from_fn(rows, columns, |_, _| normal(&mut rng))
}

fn common(seed: u64) -> CommonError {
    let factor = random_matrix(OUTPUTS, 2, seed);
    CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true }
}

/// Builds the likelihood with these options.
fn build(data: &Measurements, error: &[CommonError], text: &str) -> GaussianLikelihood {
    let chosen: Gaussian = options("gaussian", text).unwrap();
    GaussianLikelihood::new(&chosen, &Known::without_slopes(data, error)).unwrap()
}

fn likelihood(data: &Measurements, error: &[CommonError]) -> GaussianLikelihood {
    build(data, error, "variance = { uniform = [0.0, 10.0] }")
}

/// Log density of all data as one normal vector with covariance `v I + E F F' E'`, where `E` repeats each output for
/// each of its replicates, by a Cholesky factor of the whole covariance.
fn naive(data: &Measurements, error: &[CommonError], response: &[f64], v: f64) -> f64 {
    let mut residual = Vec::new();
    let mut output = Vec::new();
    for replicate in &data.replicates {
        for (i, value) in replicate.values.iter().enumerate() {
            if let Some(y) = value {
                residual.push(y - response[i]);
                output.push(i);
            }
        }
    }
    let n = residual.len();
    let covariance = Matrix::from_fn(n, n, |a, b| {
        let shared = error.iter().map(|e| {
            let (p, q) = (e.factor.row(output[a]), e.factor.row(output[b]));
            p.iter().zip(q).map(|(x, y)| x * y).sum::<f64>()
        });
        shared.sum::<f64>() + if a == b { v } else { 0.0 }
    });
    let factor = Cholesky::new(&covariance).unwrap();
    let quadratic = factor.quadratic(&residual);
    -0.5 * (n as f64 * std::f64::consts::TAU.ln() + factor.log_determinant() + quadratic)
}

#[test]
fn equals_the_normal_density_written_out() {
    for seed in 0..20 {
        let data = data(seed);
        let error = [common(seed + 100)];
        let response = random_matrix(1, OUTPUTS, seed + 200);
        for error in [&[][..], &error[..]] {
            let found = likelihood(&data, error).log_likelihood(response.row(0), &[0.7]);
            let expected = naive(&data, error, response.row(0), 0.7);
            assert!((found - expected).abs() < 1e-10 * expected.abs(), "{found} {expected}");
        }
    }
}

/// Without each replicate but the first, which alone measures every output: parts with numbers of replicates that are new,
/// and those that came before. Several responses together have the bits of each alone.
#[test]
fn a_part_given_by_the_whole_has_the_density_written_out() {
    for seed in 0..5 {
        let data = data(seed);
        let error = [common(seed + 100)];
        for error in [&[][..], &error[..]] {
            let whole = likelihood(&data, error);
            let responses = random_matrix(20, OUTPUTS, seed + 200);
            let hyper = Matrix::from_fn(20, 1, |i, _| 0.4 + 0.1 * i as f64);
            for r in [1, 2, 3, 4, 1, 2, 3, 4] {
                let mut part = data.clone();
                part.replicates[r].values.fill(None);
                let own = whole.of_part(&part).unwrap();
                let together = own.log_likelihoods(&responses, &hyper);
                for (i, found) in together.into_iter().enumerate() {
                    let alone = own.log_likelihood(responses.row(i), hyper.row(i));
                    assert_eq!(found.to_bits(), alone.to_bits());
                    let expected = naive(&part, error, responses.row(i), hyper[(i, 0)]);
                    assert!(
                        (found - expected).abs() < 1e-10 * expected.abs(),
                        "{found} {expected}"
                    );
                }
            }
            // Without the first, some outputs may have no value: another likelihood.
            let mut few = data.clone();
            few.replicates.iter_mut().for_each(|replicate| replicate.values[0] = None);
            assert!(whole.of_part(&few).is_none());
        }
    }
}

#[test]
fn the_compressed_form_equals_the_full_one() {
    for seed in 0..20 {
        let data = data(seed);
        let error = [common(seed + 100)];
        for (terms, error) in [(TERMS, &[][..]), (TERMS, &error[..]), (12, &error[..])] {
            let emulated = Emulated { coefficients: random_matrix(terms, OUTPUTS, seed + 300) };
            let full = likelihood(&data, error);
            let compressed = full.compress(&emulated).unwrap();
            let basis = random_matrix(4, terms, seed + 400);
            let hyper = Matrix::from_fn(4, 1, |i, _| 0.2 + i as f64);
            let found = compressed.log_likelihood(&basis, &hyper);
            let responses = lacuna_linalg::multiply(&basis, &emulated.coefficients);
            for (i, found) in found.iter().enumerate() {
                let expected = full.log_likelihood(responses.row(i), hyper.row(i));
                assert!((found - expected).abs() < 1e-10 * expected.abs());
            }
        }
    }
}

/// Central differences have an error of the order of `h^2`; the tolerance is a hundred times that.
#[test]
fn gradients_are_the_derivatives() {
    let data = data(3);
    let error = [common(5)];
    let full = likelihood(&data, &error);
    let emulated = Emulated { coefficients: random_matrix(TERMS, OUTPUTS, 6) };
    let compressed = full.compress(&emulated).unwrap();
    let basis = random_matrix(1, TERMS, 7);
    let response = lacuna_linalg::multiply(&basis, &emulated.coefficients);
    let (v, h) = (0.6, 1e-5);
    let at = |moved: &[f64], v: f64| full.log_likelihood(moved, &[v]);
    let (by_response, by_hyper) = full.gradient(response.row(0), &[v]);
    for i in 0..OUTPUTS {
        let mut above = response.row(0).to_vec();
        let mut below = above.clone();
        above[i] += h;
        below[i] -= h;
        let slope = (at(&above, v) - at(&below, v)) / (2.0 * h);
        assert!((slope - by_response[i]).abs() < 1e-6 * (1.0 + slope.abs()));
    }
    let slope = (at(response.row(0), v + h) - at(response.row(0), v - h)) / (2.0 * h);
    assert!((slope - by_hyper[0]).abs() < 1e-6 * (1.0 + slope.abs()));
    let (by_basis, by_variance) = compressed.gradient(basis.row(0), &[v]);
    let chained =
        lacuna_linalg::multiply(&emulated.coefficients, &Matrix::from_vec(OUTPUTS, 1, by_response));
    for j in 0..TERMS {
        assert!((by_basis[j] - chained[(j, 0)]).abs() < 1e-10 * (1.0 + by_basis[j].abs()));
    }
    assert!((by_variance[0] - by_hyper[0]).abs() < 1e-10 * (1.0 + by_hyper[0].abs()));
}

#[test]
fn simulated_data_have_the_gaps_of_the_measurements_and_the_variance_asked_for() {
    let data = data(4);
    let full = likelihood(&data, &[]);
    let response = vec![1.0; OUTPUTS];
    let mut squares = 0.0;
    let mut count = 0.0;
    for k in 0..400 {
        let simulated = full.simulate(&response, &[0.25], &Stream::root(9).at(k));
        for (made, real) in simulated[0].replicates.iter().zip(&data.replicates) {
            for (m, r) in made.values.iter().zip(&real.values) {
                assert_eq!(m.is_some(), r.is_some());
                if let Some(m) = m {
                    squares += (m - 1.0) * (m - 1.0);
                    count += 1.0;
                }
            }
        }
    }
    // The mean square of n normal numbers of variance v has the standard deviation v sqrt(2/n).
    let bound = 4.0 * 0.25 * f64::sqrt(2.0 / count);
    assert!((squares / count - 0.25).abs() < bound);
}

#[test]
fn some_densities_of_left_out_data_are_those_of_all() {
    let data = data(8);
    for error in [&[][..], &[common(9)][..]] {
        let full = likelihood(&data, error);
        let response = random_matrix(1, OUTPUTS, 10);
        let all = full.left_out(response.row(0), &[0.7]).unwrap();
        let which: Vec<usize> = (0..all.len()).filter(|i| i % 3 != 1).collect();
        let some = full.left_out_at(response.row(0), &[0.7], &which).unwrap();
        let expected: Vec<f64> = which.iter().map(|&i| all[i]).collect();
        assert_eq!(some, expected);
    }
}

/// Means and scatters drawn without the data have the distribution of those of simulated data: their means and variances
/// over many simulations agree within five standard errors, with common errors too.
#[test]
fn simulated_summaries_are_those_of_simulated_data() {
    let data = data(12);
    let full = likelihood(&data, &[common(13)]);
    let response = vec![1.0; OUTPUTS];
    let count = 4000;
    let each = |number: &dyn Fn(u64, usize) -> f64, i: usize| {
        let values: Vec<f64> = (0..count).map(|k| number(k, i)).collect();
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares: Vec<f64> = values.iter().map(|x| (x - mean).powi(2)).collect();
        let variance = squares.iter().sum::<f64>() / count as f64;
        let fourth = squares.iter().map(|s| (s - variance).powi(2)).sum::<f64>() / count as f64;
        [(mean, variance / count as f64), (variance, fourth / count as f64)]
    };
    let simulated: Vec<_> = (0..count)
        .map(|k| full.simulate(&response, &[0.25], &Stream::root(14).at(k))[0].summaries())
        .collect();
    let drawn: Vec<_> = (0..count)
        .map(|k| full.simulate_summaries(&response, &[0.25], &Stream::root(15).at(k)).unwrap())
        .collect();
    for i in 0..OUTPUTS {
        assert_eq!(simulated[0][i].count, drawn[0][0][i].count);
        let pairs = [
            (
                each(&|k, i| simulated[k as usize][i].mean, i),
                each(&|k, i| drawn[k as usize][0][i].mean, i),
            ),
            (
                each(&|k, i| simulated[k as usize][i].scatter, i),
                each(&|k, i| drawn[k as usize][0][i].scatter, i),
            ),
        ];
        for ([a, b], [c, d]) in pairs {
            for ((a, of_a), (c, of_c)) in [(a, c), (b, d)] {
                assert!((a - c).abs() <= 5.0 * (of_a + of_c).sqrt(), "{i}: {a} and {c}");
            }
        }
    }
}
