//! Data that state their noise: against the dense normal density of all data, and against generalised least squares
//! in closed form (Aitken 1936).

use lacuna::data::Measurements;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::Discrepancy;
use lacuna::plugin::discrepancy::{CommonError, Known, Likelihood};
use lacuna_linalg::{Cholesky, Matrix};

use super::{OUTPUTS, common, data, random_matrix};
use crate::discrepancies::common::testing::{close, has_its_derivatives, options};
use crate::discrepancies::gaussian::Gaussian;

fn build(data: &Measurements, error: &[CommonError], text: &str) -> Box<dyn Likelihood> {
    let chosen: Gaussian = options("gaussian", text).unwrap();
    chosen.likelihood(&Known::without_slopes(data, error)).unwrap()
}

/// Standard deviations of each value, the same for all replicates or not.
fn with_sigma(seed: u64, alike: bool) -> Measurements {
    let mut data = data(seed);
    for (r, replicate) in data.replicates.iter_mut().enumerate() {
        let mut rng = Stream::root(seed + 50).at(if alike { 0 } else { r as u64 }).generator();
        let sd = (0..OUTPUTS).map(|_| 0.2 + uniform(&mut rng)).collect();
        replicate.sd = Some(sd);
    }
    data
}

/// Data with the covariance of one curve.
fn with_covariance(seed: u64) -> Measurements {
    let root = random_matrix(OUTPUTS, OUTPUTS, seed + 60);
    let mut covariance = lacuna_linalg::gram(&root);
    (0..OUTPUTS).for_each(|i| covariance[(i, i)] += 0.3);
    Measurements { covariance: Some(covariance), ..data(seed) }
}

/// All data as one normal vector: the stated noise of each replicate times `scale`, plus `added` on the diagonal, and
/// the errors common to all replicates.
fn written_out(
    data: &Measurements,
    error: &[CommonError],
    response: &[f64],
    (scale, added): (f64, f64),
) -> f64 {
    let values = || {
        data.replicates.iter().enumerate().flat_map(|(r, replicate)| {
            replicate.values.iter().enumerate().filter_map(move |(i, y)| Some((r, i, (*y)?)))
        })
    };
    let places: Vec<(usize, usize)> = values().map(|(r, i, _)| (r, i)).collect();
    let residual: Vec<f64> = values().map(|(_, i, y)| y - response[i]).collect();
    let noise = |r: usize, i: usize, j: usize| match (&data.covariance, &data.replicates[r].sd) {
        (Some(covariance), _) => covariance[(i, j)],
        (None, Some(sd)) if i == j => sd[i] * sd[i],
        _ => 0.0,
    };
    let n = residual.len();
    let covariance = Matrix::from_fn(n, n, |a, b| {
        let ((r, i), (s, j)) = (places[a], places[b]);
        let shared =
            error.iter().map(|e| lacuna_linalg::vector::dot(e.factor.row(i), e.factor.row(j)));
        let own = if r == s { scale * noise(r, i, j) } else { 0.0 };
        shared.sum::<f64>() + own + if a == b { added } else { 0.0 }
    });
    let factor = Cholesky::new(&covariance).unwrap();
    -0.5 * (n as f64 * std::f64::consts::TAU.ln()
        + factor.log_determinant()
        + factor.quadratic(&residual))
}

const ALONE: &str = "variance = { measured = { known = 1 } }";
const SCALED: &str = "variance = { measured = { uniform = [0.1, 10] } }";
const ADDED: &str = "variance = { half_normal = 1 }";
const FIXED: &str = "variance = { known = 0.4 }";

#[test]
fn equals_the_normal_density_written_out() {
    for seed in 0..10 {
        let error = [common(seed + 100)];
        let response = random_matrix(1, OUTPUTS, seed + 200);
        let response = response.row(0);
        for data in [with_sigma(seed, true), with_sigma(seed, false), with_covariance(seed)] {
            for error in [&[][..], &error[..]] {
                for (text, hyper, of) in [
                    (ALONE, &[][..], (1.0, 0.0)),
                    (SCALED, &[1.7][..], (1.7, 0.0)),
                    (ADDED, &[0.3][..], (1.0, 0.3)),
                    (FIXED, &[][..], (1.0, 0.4)),
                ] {
                    let built = build(&data, error, text);
                    assert_eq!(built.hyperparameters().len(), hyper.len());
                    let expected = written_out(&data, error, response, of);
                    close(built.log_likelihood(response, hyper), expected, 1e-9);
                    has_its_derivatives(&*built, response, hyper);
                }
            }
        }
    }
}

/// The data without one replicate keep the distribution of all data.
#[test]
fn a_part_has_the_density_written_out() {
    let error = [common(5)];
    let response: Vec<f64> = (0..OUTPUTS).map(|i| 0.1 * i as f64).collect();
    for whole in [with_sigma(9, false), with_sigma(9, true), with_covariance(9)] {
        let chosen: Gaussian = options("gaussian", FIXED).unwrap();
        let mut part = whole.clone();
        part.replicates[1].values.fill(None);
        let known = Known::without_slopes(&whole, &error);
        let likelihood = chosen.likelihood_of_part(&known, &part).unwrap().unwrap();
        let expected = written_out(&part, &error, &response, (1.0, 0.4));
        close(likelihood.log_likelihood(&response, &[]), expected, 1e-10);
    }
}

/// Checks each value given all others by removing it from the data.
#[test]
fn values_left_out_have_their_conditional_densities() {
    let error = [common(7)];
    let response = random_matrix(1, OUTPUTS, 8);
    let response = response.row(0);
    let data = with_sigma(3, false);
    let found = build(&data, &error, ADDED).left_out(response, &[0.3]).unwrap();
    let whole = written_out(&data, &error, response, (1.0, 0.3));
    let mut next = found.iter();
    for r in 0..data.replicates.len() {
        for i in 0..OUTPUTS {
            if data.replicates[r].values[i].is_some() {
                let mut others = data.clone();
                others.replicates[r].values[i] = None;
                let expected = whole - written_out(&others, &error, response, (1.0, 0.3));
                close(*next.next().unwrap(), expected, 1e-9);
            }
        }
    }
    assert!(next.next().is_none());
}

/// For the straight line `a + b t` the likelihood is `exp(-(b - b0)' H (b - b0) / 2)` about the estimate
/// `b0 = H^-1 X'S^-1 y` with `H = X'S^-1 X`.
#[test]
fn a_straight_line_is_generalised_least_squares() {
    for (seed, of_curve) in [(1, false), (2, true)] {
        let mut data = if of_curve { with_covariance(seed) } else { with_sigma(seed, false) };
        data.replicates.truncate(1);
        let used: Vec<usize> =
            (0..OUTPUTS).filter(|&i| data.replicates[0].values[i].is_some()).collect();
        let n = used.len();
        let noise = Matrix::from_fn(n, n, |a, b| match &data.covariance {
            Some(c) => c[(used[a], used[b])],
            None if a == b => data.replicates[0].sd.as_ref().unwrap()[used[a]].powi(2),
            None => 0.0,
        });
        let line = |i: usize| [1.0, i as f64];
        let white = Cholesky::new(&noise).unwrap();
        let x = white.whiten_matrix(&Matrix::from_fn(n, 2, |k, j| line(used[k])[j]));
        let mut y: Vec<f64> = used.iter().map(|&i| data.replicates[0].values[i].unwrap()).collect();
        white.whiten(&mut y);
        let h = lacuna_linalg::gram(&x);
        let mut estimate = lacuna_linalg::transposed_multiply_vector(&x, &y);
        Cholesky::new(&h).unwrap().solve(&mut estimate);
        let built = build(&data, &[], ALONE);
        let at = |b: &[f64]| -> f64 {
            let response: Vec<f64> =
                (0..OUTPUTS).map(|i| lacuna_linalg::vector::dot(&line(i), b)).collect();
            built.log_likelihood(&response, &[])
        };
        let best = at(&estimate);
        let mut rng = Stream::root(seed).generator();
        for _ in 0..20 {
            let step = [normal(&mut rng), normal(&mut rng)];
            let b = [estimate[0] + step[0], estimate[1] + step[1]];
            let expected = -0.5
                * lacuna_linalg::vector::dot(&step, &lacuna_linalg::multiply_vector(&h, &step));
            close(at(&b) - best, expected, 1e-7);
        }
    }
}

/// New data have the stated noise: the mean square of each value over its variance is one, within four standard
/// errors of 4000 draws.
#[test]
fn simulated_data_have_the_stated_noise() {
    let response = vec![0.0; OUTPUTS];
    for data in [with_sigma(4, false), with_covariance(4)] {
        let built = build(&data, &[], ADDED);
        let mut squares = [0.0; OUTPUTS];
        let draws = 4000;
        for draw in 0..draws {
            let made = &built.simulate(&response, &[0.3], &Stream::root(9).at(draw))[0];
            for (i, square) in squares.iter_mut().enumerate() {
                *square += made.replicates[0].values[i].map_or(f64::NAN, |y| y * y);
            }
        }
        for (i, square) in squares.iter().enumerate().filter(|(_, s)| s.is_finite()) {
            let variance = data.stated_variance(&data.replicates[0], i).unwrap() + 0.3;
            let ratio = square / draws as f64 / variance;
            close(ratio, 1.0, 4.0 * (2.0 / draws as f64).sqrt());
        }
        let parts = built.predictive(&response, &[0.3]);
        assert_eq!(parts[0].origin.as_str(), "measurement");
        close(parts[1].variance[0], 0.3, 1e-12);
    }
}

#[test]
fn what_cannot_be_told_apart_is_refused() {
    let data = with_covariance(1);
    let refused = |text: &str| {
        let chosen: Gaussian = options("gaussian", text).unwrap();
        let built = chosen.likelihood(&Known::without_slopes(&data, &[]));
        built.err().map(|stop| stop.message).unwrap_or_default()
    };
    let by = refused("variance = { half_normal = 1 }\nby = \"time\"");
    assert_eq!(by, "several variances cannot be estimated if the measurements state a covariance");
    let marginal = refused("variance = { half_normal = 1 }\nmarginal = true");
    assert!(marginal.starts_with("a variance cannot be integrated out"), "{marginal}");
}
