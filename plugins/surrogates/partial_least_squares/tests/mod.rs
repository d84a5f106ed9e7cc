#![allow(clippy::unwrap_used)]

mod bench;
mod functions;

use lacuna::data::{Layout, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::surrogate::{Emulator, Surrogate, Training};
use lacuna::run::{Progress, Silent, Stop};
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;

use super::PartialLeastSquares;
use super::directions::directions;

/// Parameters with these designs.
fn parameters(designs: &[Distribution]) -> Vec<Parameter> {
    let parameter = |(i, design): (usize, &Distribution)| Parameter {
        name: format!("x{}", i + 1),
        symbol: format!("x{}", i + 1),
        unit: Unit::dimensionless(),
        design: design.clone(),
        prior: design.clone(),
        reference: None,
    };
    designs.iter().enumerate().map(parameter).collect()
}

fn drawn(parameters: &[Parameter], runs: usize, stream: &Stream) -> Matrix {
    let mut rng = stream.generator();
    Matrix::from_fn(runs, parameters.len(), |_, j| {
        parameters[j].design.quantile(uniform(&mut rng))
    })
}

/// Fits a surrogate to the values of functions at points.
fn fitted(
    surrogate: &dyn Surrogate,
    parameters: &[Parameter],
    points: &Matrix,
    responses: &Matrix,
) -> Result<Box<dyn Emulator>, Stop> {
    let layouts = Layout::number("y").into();
    let training = Training { parameters, layouts: &layouts, points, responses };
    surrogate.fit(&training, &Stream::root(3).named("surrogate"), &Progress::new(&Silent))
}

fn values(points: &Matrix, function: impl Fn(&[f64]) -> f64) -> Matrix {
    Matrix::from_rows(1, points.iter_rows().map(|x| [function(x)]))
}

/// Mean square of the differences as a share of the variance.
fn share(found: &Matrix, expected: &Matrix) -> f64 {
    let (found, expected) = (found.as_slice(), expected.as_slice());
    let mean = expected.iter().sum::<f64>() / expected.len() as f64;
    let error: f64 = found.iter().zip(expected).map(|(a, b)| (a - b).powi(2)).sum();
    error / expected.iter().map(|y| (y - mean).powi(2)).sum::<f64>()
}

#[test]
fn it_keeps_the_contract() {
    let plugin = PartialLeastSquares::default();
    assert_eq!(lacuna_contract::surrogate("partial_least_squares", &plugin), Ok(()));
}

/// A function of one direction of 40 normal inputs: `y = exp(w' x / 2)`. Directions of partial least squares are
/// consistent for such functions (Naik and Tsai 2000), and the error at new points is that of the left-out runs.
#[test]
fn a_function_of_one_direction_is_learned_from_few_runs() {
    let parameters = parameters(&vec![Distribution::Normal([2.0, 0.5]); 40]);
    let weights: Vec<f64> = (0..40).map(|k| f64::from(k % 5) - 1.5).collect();
    let length = dot(&weights, &weights).sqrt();
    let function = |x: &[f64]| {
        let position: f64 = x.iter().zip(&weights).map(|(x, w)| (x - 2.0) / 0.5 * w / length).sum();
        (0.5 * position).exp()
    };
    let points = drawn(&parameters, 150, &Stream::root(1));
    let fresh = drawn(&parameters, 1000, &Stream::root(2));
    let emulator =
        fitted(&PartialLeastSquares::default(), &parameters, &points, &values(&points, function));
    let emulator = emulator.unwrap();
    let error = share(&emulator.mean(&fresh), &values(&fresh, function));
    assert!(error < 0.01, "{error}");
    let stated = emulator.fit_error().relative[0];
    assert!(stated < 3.0 * error && error < 3.0 * stated, "{stated} {error}");
}

/// Three inputs in three directions are all there is: the expansion is then one in rotated inputs, and a polynomial is
/// learned to rounding errors.
#[test]
fn a_polynomial_of_three_inputs_is_exact() {
    let designs = [
        Distribution::Uniform([-1.0, 3.0]),
        Distribution::Normal([5.0, 2.0]),
        Distribution::LogUniform([1.0, 10.0]),
    ];
    let parameters = parameters(&designs);
    let function = |x: &[f64]| {
        let (a, b, c) = ((x[0] - 1.0) / 2.0, (x[1] - 5.0) / 2.0, x[2].ln());
        1.0 + a + 2.0 * b - c + a * b + 0.5 * a * a
    };
    let points = drawn(&parameters, 60, &Stream::root(4));
    let fresh = drawn(&parameters, 100, &Stream::root(5));
    let surrogate = PartialLeastSquares::default();
    let emulator = fitted(&surrogate, &parameters, &points, &values(&points, function)).unwrap();
    let error = share(&emulator.mean(&fresh), &values(&fresh, function));
    assert!(error < 1e-18, "{error}");
}

/// A sum of unrelated products has no direction: the error at left-out runs is that at new points, and close to one.
#[test]
fn what_has_no_direction_is_reported() {
    let parameters = parameters(&vec![Distribution::Uniform([-1.0, 1.0]); 30]);
    let function = |x: &[f64]| x.chunks(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
    let points = drawn(&parameters, 120, &Stream::root(6));
    let fresh = drawn(&parameters, 1000, &Stream::root(7));
    let surrogate = PartialLeastSquares::default();
    let emulator = fitted(&surrogate, &parameters, &points, &values(&points, function)).unwrap();
    let error = share(&emulator.mean(&fresh), &values(&fresh, function));
    let stated = emulator.fit_error().relative[0];
    assert!(error > 0.7 && stated > 0.7, "{error} {stated}");
    assert!((stated / error - 1.0).abs() < 0.4, "{error} {stated}");
}

/// Without refinement and with one direction this is the first direction of linear partial least squares: the normalised
/// covariance of centred inputs and output.
#[test]
fn the_first_direction_is_the_covariance() {
    let mut rng = Stream::root(8).generator();
    let inputs = Matrix::from_fn(50, 6, |_, _| normal(&mut rng));
    let output: Vec<f64> = (0..50).map(|_| normal(&mut rng)).collect();
    let found = directions(&inputs, &output, 4, 0);
    let mean = output.iter().sum::<f64>() / 50.0;
    let covariance: Vec<f64> = (0..6)
        .map(|j| (0..50).map(|i| inputs[(i, j)] * (output[i] - mean)).sum::<f64>())
        .collect();
    let length = dot(&covariance, &covariance).sqrt();
    for (j, c) in covariance.iter().enumerate() {
        assert!((found[(j, 0)] - c / length).abs() < 1e-12);
    }
    for a in 0..4 {
        for b in 0..=a {
            let product = dot(&found.column(a), &found.column(b));
            assert!((product - f64::from(u8::from(a == b))).abs() < 1e-12);
        }
    }
}

#[test]
fn invalid_options_are_reported_together() {
    let options = PartialLeastSquares {
        max_directions: 0,
        folds: 1,
        max_terms: 0,
        ..PartialLeastSquares::default()
    };
    let keys: Vec<&str> = options.faults(Some(50)).into_iter().map(|(key, _)| key).collect();
    assert_eq!(keys, ["max_directions", "max_terms", "folds"]);
    let few = PartialLeastSquares { folds: 2, ..PartialLeastSquares::default() };
    assert_eq!(few.faults(Some(5)).len(), 1);
    assert!(few.faults(Some(6)).is_empty());
}
