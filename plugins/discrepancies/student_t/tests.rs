//! The likelihood against Student's t density, its limit against the normal distribution, and the directions of the
//! common errors against generalised least squares with the full covariance.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Measurements, Replicate};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Discrepancy;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, Known, Likelihood};
use lacuna_linalg::vector::dot;
use lacuna_linalg::{
    Cholesky, Matrix, multiply_vector, transposed_multiply, transposed_multiply_vector,
};

use super::StudentT;
use super::likelihood::StudentLikelihood;
use crate::discrepancies::common::Replicates;
use crate::discrepancies::common::testing::{
    OUTPUTS, TIMES, close, common, data, has_its_derivatives, layout, options, random_matrix,
    shared,
};

fn build(text: &str, known: &Known<'_>) -> Box<dyn Likelihood> {
    let chosen: StudentT = options("student_t", text).unwrap();
    chosen.likelihood(known).unwrap()
}

const ALL: &str = "scale = { half_normal = 1 }\nby = \"sensor\"\ncommon = { share = 1.0 }";

/// Given the weights it is the Student's t density of the residuals about the response with their error; over
/// standard normal weights that error has the covariance `F F'`.
#[test]
fn it_is_the_density_written_out() {
    for seed in 0..5 {
        let (data, error) = (data(seed, 4), [common(seed + 1)]);
        let response = random_matrix(1, OUTPUTS, seed + 2);
        let options: StudentT = options("student_t", ALL).unwrap();
        let likelihood =
            StudentLikelihood::new(&options, &Known::without_slopes(&data, &error)).unwrap();
        let names: Vec<&str> =
            likelihood.hyperparameters().iter().map(|h| h.name.as_str()).collect();
        assert_eq!(names[2..], ["scale[G]", "degrees_of_freedom", "common[1]", "common[2]"]);
        let error_of = |weights: [f64; 2]| -> Vec<f64> {
            let hyper = [0.3, 0.5, 0.7, 4.5, weights[0], weights[1]];
            likelihood.mean(&[0.0; OUTPUTS], &hyper)
        };
        let (first, second) = (error_of([1.0, 0.0]), error_of([0.0, 1.0]));
        for i in 0..OUTPUTS {
            for j in 0..OUTPUTS {
                let expected = dot(error[0].factor.row(i), error[0].factor.row(j));
                close(first[i] * first[j] + second[i] * second[j], expected, 1e-10);
            }
        }
        let hyper = [0.3, 0.5, 0.7, 4.5, 0.6, -1.2];
        let shift = error_of([0.6, -1.2]);
        let mut expected = 0.0;
        for replicate in &data.replicates {
            for (i, value) in replicate.values.iter().enumerate() {
                let Some(y) = value else { continue };
                let law =
                    Distribution::StudentT([4.5, response[(0, i)] + shift[i], hyper[i / TIMES]]);
                expected += law.log_density(*y);
            }
        }
        close(likelihood.log_likelihood(response.row(0), &hyper), expected, 1e-12);
        has_its_derivatives(&likelihood, response.row(0), &hyper);
        let left_out: f64 = likelihood.left_out(response.row(0), &hyper).unwrap().iter().sum();
        close(left_out, expected, 1e-10);
    }
}

/// Estimate and covariance under a quadratic density of two parameters and some weights, with the weights integrated
/// out, from gradients, which are linear then.
fn marginal(likelihood: &dyn Likelihood, slopes: &Matrix, scale: f64) -> (Vec<f64>, Matrix) {
    let weights = likelihood.hyperparameters().len() - 1;
    let size = 2 + weights;
    let score = |x: &[f64]| -> Vec<f64> {
        let hyper = [&[scale], &x[2..]].concat();
        let (by_response, by_hyper) =
            likelihood.gradient(&multiply_vector(slopes, &x[..2]), &hyper);
        let by_parameter = transposed_multiply_vector(slopes, &by_response);
        let prior = x.iter().map(|x| -x);
        let all = by_parameter.into_iter().chain(by_hyper[1..].iter().copied());
        all.zip(prior).map(|(a, b)| a + b).collect()
    };
    let at_zero = score(&vec![0.0; size]);
    let columns = (0..size).map(|j| {
        let mut x = vec![0.0; size];
        x[j] = 1.0;
        score(&x).iter().zip(&at_zero).map(|(one, zero)| zero - one).collect::<Vec<f64>>()
    });
    let information = Cholesky::new(&Matrix::from_rows(size, columns)).unwrap();
    let mut estimate = at_zero;
    information.solve(&mut estimate);
    let covariance = information.inverse().select_rows(&[0, 1]).select_columns(&[0, 1]);
    (estimate[..2].to_vec(), covariance)
}

/// With common errors in twelve directions, all larger than the noise of the mean curve, the posterior of two
/// parameters is that of generalised least squares with the full covariance, at the sizes of the noise for which
/// directions are chosen, and nearly so in between. With as many leading directions instead it is at least a fifth
/// narrower.
#[test]
fn a_few_directions_do_what_the_whole_covariance_does() {
    let (data, slopes, error) = twelve_directions();
    let of_slopes = || Ok(slopes.clone());
    let known = Known { data: &data, common: &error, slopes: &of_slopes, parameters: &[] };
    let replicates = Replicates::of(&data, &error).unwrap();
    let text = "scale = { half_normal = 1 }\ndegrees_of_freedom = { known = 1e9 }";
    let likelihood = build(&format!("{text}\ncommon = {{ share = 0.0, most = 0 }}"), &known);
    assert_eq!(likelihood.hyperparameters().len(), 1 + 6);
    let start = likelihood.hyperparameters()[0].start;
    for (size, tolerance) in [(0.5, 1e-4), (1.0, 1e-4), (2.0, 1e-4), (0.7, 0.05), (1.5, 0.05)] {
        let scale = size * start;
        let (estimate, covariance) = marginal(&*likelihood, &slopes, scale);
        let whole = shared(&error);
        let total = Cholesky::new(&Matrix::from_fn(OUTPUTS, OUTPUTS, |i, j| {
            whole(i, j) + if i == j { scale * scale / replicates.count[i] } else { 0.0 }
        }))
        .unwrap();
        let mut information = transposed_multiply(&slopes, &total.solve_matrix(&slopes));
        (0..2).for_each(|j| information[(j, j)] += 1.0);
        let expected = Cholesky::new(&information).unwrap().inverse();
        let mut residual = replicates.mean.clone();
        total.solve(&mut residual);
        let exact = multiply_vector(&expected, &transposed_multiply_vector(&slopes, &residual));
        for j in 0..2 {
            let sd = expected[(j, j)].sqrt();
            assert!((covariance[(j, j)].sqrt() / sd - 1.0).abs() < tolerance, "{size}");
            assert!((estimate[j] - exact[j]).abs() < tolerance * sd, "{size}");
        }
    }
    let none = || Ok(Matrix::zeros(OUTPUTS, 2));
    let leading = format!("{text}\ncommon = {{ share = 1.0, most = 6 }}");
    let leading = build(&leading, &Known { slopes: &none, ..known });
    assert_eq!(leading.hyperparameters().len(), 1 + 6);
    let (_, narrow) = marginal(&*leading, &slopes, start);
    let (_, right) = marginal(&*likelihood, &slopes, start);
    assert!((0..2).all(|j| narrow[(j, j)] < 0.64 * right[(j, j)]), "{narrow:?} {right:?}");
}

#[test]
fn no_error_has_no_weights() {
    let data = full(5, 3);
    let nothing = Matrix::zeros(OUTPUTS, 2);
    let error =
        [CommonError { origin: ErrorOrigin::Emulator, factor: nothing.into(), predictive: true }];
    let likelihood = build("scale = { known = 1 }", &Known::without_slopes(&data, &error));
    assert_eq!(likelihood.hyperparameters().len(), 1);
    assert_eq!(likelihood.sampled_errors(&[4.0]), None);
}

/// Simulated data have the variance of the full error: sampled directions and the rest.
#[test]
fn new_data_have_the_whole_error() {
    let (data, slopes, error) = twelve_directions();
    let of_slopes = || Ok(slopes.clone());
    let known = Known { data: &data, common: &error, slopes: &of_slopes, parameters: &[] };
    let text = "scale = { known = 0.01 }\ndegrees_of_freedom = { known = 5 }\ncommon = { share = 0.0, most = 1 }";
    let likelihood = build(text, &known);
    let (count, weights) = (20_000, likelihood.hyperparameters().len());
    let (mut simulated, mut stated) = (vec![0.0; OUTPUTS], vec![0.0; OUTPUTS]);
    for k in 0..count {
        let stream = Stream::root(9).at(k);
        let mut rng = stream.named("weights").generator();
        let hyper: Vec<f64> = (0..weights).map(|_| normal(&mut rng)).collect();
        let made = likelihood.simulate(&[0.0; OUTPUTS], &hyper, &stream).remove(0);
        let parts = likelihood.predictive(&[0.0; OUTPUTS], &hyper);
        let emulator = parts.iter().find(|part| part.origin == ErrorOrigin::Emulator).unwrap();
        for i in 0..OUTPUTS {
            simulated[i] += made.replicates[0].values[i].unwrap().powi(2) / count as f64;
            stated[i] += emulator.variance[i] / count as f64;
        }
    }
    // The mean square of so many values has the relative standard deviation sqrt(2 / count); the noise is 1e-4 of it.
    let tolerance = 4.0 * (2.0 / count as f64).sqrt() + 1e-3;
    for i in 0..OUTPUTS {
        let expected = dot(error[0].factor.row(i), error[0].factor.row(i));
        close(simulated[i], expected, tolerance);
        close(stated[i], expected, tolerance);
    }
}

/// Three replicates, derivatives with respect to two parameters, and an error in twelve directions larger than the
/// noise of the mean curve.
fn twelve_directions() -> (Measurements, Matrix, [CommonError; 1]) {
    let factor = random_matrix(OUTPUTS, 12, 12);
    let error =
        CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true };
    (full(5, 3), random_matrix(OUTPUTS, 2, 11), [error])
}

/// Replicates without gaps.
fn full(seed: u64, replicates: usize) -> Measurements {
    let values = random_matrix(replicates, OUTPUTS, seed);
    let replicate =
        |r: usize| Replicate::new(r.to_string(), values.row(r).iter().map(|y| Some(*y)).collect());
    Measurements::new(layout(), (0..replicates).map(replicate).collect())
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

/// An outlier of one sensor moves the estimated mean under the normal distribution, but hardly under Student's t.
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
