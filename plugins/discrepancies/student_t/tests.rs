//! The likelihood against Student's density written out, and its limit against the normal law.
#![allow(clippy::unwrap_used)]

use lacuna::linalg::vector::dot;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Discrepancy;
use lacuna::plugin::discrepancy::{Known, Likelihood};

use super::StudentT;
use crate::discrepancies::common::testing::{
    OUTPUTS, TIMES, close, common, data, has_its_derivatives, options, random_matrix,
};

fn build(text: &str, known: &Known<'_>) -> Box<dyn Likelihood> {
    let chosen: StudentT = options("student_t", text).unwrap();
    chosen.likelihood(known).unwrap()
}

const ALL: &str = "scale = { half_normal = 1 }\nby = \"sensor\"\ncommon = { share = 1.0 }";

/// The weights stand for the error they are made from: over standard normal weights the covariance is `F F'`.
#[test]
fn it_is_the_density_written_out() {
    for seed in 0..5 {
        let (data, error) = (data(seed, 4), [common(seed + 1)]);
        let response = random_matrix(1, OUTPUTS, seed + 2);
        let likelihood = build(ALL, &Known::without_slopes(&data, &error));
        let names: Vec<&str> =
            likelihood.hyperparameters().iter().map(|h| h.name.as_str()).collect();
        assert_eq!(names[2..], ["scale[G]", "degrees_of_freedom", "emulator[1]", "emulator[2]"]);
        let hyper = [0.3, 0.5, 0.7, 4.5, 0.6, -1.2];
        let weights = |w: [f64; 2]| {
            let mut hyper = hyper;
            hyper[4..].copy_from_slice(&w);
            likelihood.predictive(response.row(0), &hyper)[2].variance.clone()
        };
        let (first, second) = (weights([1.0, 0.0]), weights([0.0, 1.0]));
        for i in 0..OUTPUTS {
            let row = error[0].factor.row(i);
            close(first[i] + second[i], dot(row, row), 1e-12);
        }
        // The shift of the mean is found from responses that undo it.
        let at = |m: &[f64]| likelihood.log_likelihood(m, &hyper);
        let squares = weights([0.6, -1.2]);
        let mut best = f64::NEG_INFINITY;
        for sign in [-1.0, 1.0] {
            let mut expected = 0.0;
            let i = 1;
            for r in &data.replicates {
                let Some(y) = r.values[i] else { continue };
                let mean = response[(0, i)] + sign * squares[i].sqrt();
                expected += Distribution::StudentT([4.5, mean, 0.3]).log_density(y);
            }
            let mut less = data.clone();
            less.replicates.iter_mut().for_each(|r| r.values[i] = None);
            let rest = build(ALL, &Known::without_slopes(&less, &[]));
            let full = build(ALL, &Known::without_slopes(&data, &[]));
            let mut moved = response.row(0).to_vec();
            moved[i] += sign * squares[i].sqrt();
            let own =
                full.log_likelihood(&moved, &hyper[..4]) - rest.log_likelihood(&moved, &hyper[..4]);
            close(own, expected, 1e-10);
            best = best.max(own);
        }
        assert!(best.is_finite() && at(response.row(0)).is_finite());
        has_its_derivatives(&*likelihood, response.row(0), &hyper);
        let left_out: f64 = likelihood.left_out(response.row(0), &hyper).unwrap().iter().sum();
        close(left_out, at(response.row(0)), 1e-10);
    }
}

#[test]
fn for_many_degrees_of_freedom_it_is_the_normal_law() {
    let data = data(3, 4);
    let known = Known::without_slopes(&data, &[]);
    let likelihood = build(
        "scale = { known = [0.3, 0.5, 0.7] }\nby = \"sensor\"\ndegrees_of_freedom = { known = 1e9 }",
        &known,
    );
    let response = random_matrix(1, OUTPUTS, 4);
    let mut expected = 0.0;
    for r in &data.replicates {
        for (i, y) in r.values.iter().enumerate() {
            let sd = 0.3 + 0.2 * (i / TIMES) as f64;
            expected +=
                y.map_or(0.0, |y| Distribution::Normal([response[(0, i)], sd]).log_density(y));
        }
    }
    // The first correction is of the order of z^4 / (4 f).
    close(likelihood.log_likelihood(response.row(0), &[]), expected, 1e-6);
}

/// The wild value of a sensor moves the best mean of the normal law, but hardly that of Student's.
#[test]
fn no_variance_is_refused_and_wild_values_pull_less() {
    let data = data(3, 4);
    let likelihood = build("scale = { half_normal = 1 }", &Known::without_slopes(&data, &[]));
    assert_eq!(likelihood.log_likelihood(&[0.0; OUTPUTS], &[1.0, 2.0]), f64::NEG_INFINITY);
    let pull = |y: f64| {
        let mut wild = data.clone();
        wild.replicates[0].values[0] = Some(y);
        let likelihood = build("scale = { half_normal = 1 }", &Known::without_slopes(&wild, &[]));
        likelihood.gradient(&[0.0; OUTPUTS], &[1.0, 4.0]).0[0]
    };
    assert!(pull(1000.0) - pull(0.0) < 0.1 * (pull(2.0) - pull(0.0)));
}
