//! The compressed forms on a smooth problem of the founding study's size, against the sum over all data.

use lacuna::data::{Axis, Layout, Measurements, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::Emulator;
use lacuna::plugin::discrepancy::{CommonError, Compressed, ErrorOrigin, Likelihood};
use lacuna::plugin::surrogate::{Surrogate, Training};
use lacuna::run::{Progress, Silent};
use lacuna_linalg::Matrix;

use super::{GaussianLikelihood, build, random_matrix};
use crate::discrepancies::gaussian::compressed::CompressedGaussian;
use crate::surrogates::polynomial_chaos::{Degree, PolynomialChaos, Solver};

const SENSORS: usize = 10;
const TIMES: usize = 100;
const BOX: [[f64; 2]; 3] = [[0.0, 1e6], [1e4, 1.36e4], [1200.0, 2200.0]];

/// Strain of a damped wave that arrives at each sensor at its own time.
fn response(theta: &[f64]) -> Vec<f64> {
    let [cutoff, density, speed] = [theta[0] / 1e6, theta[1] / 1e4, theta[2] / 1e3];
    let strain = |k: usize| {
        let (sensor, time) = ((k / TIMES) as f64, (k % TIMES) as f64 / TIMES as f64);
        let since = time - 0.05 * sensor / speed;
        let envelope = 1.0 / (1.0 + (-40.0 * since).exp()) * (-since * (2.0 + cutoff)).exp();
        1e-4 * density * envelope * ((9.0 + sensor) * speed * since / density).sin()
    };
    (0..SENSORS * TIMES).map(strain).collect()
}

fn points(count: usize, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).generator();
    Matrix::from_fn(count, 3, |_, i| BOX[i][0] + uniform(&mut rng) * (BOX[i][1] - BOX[i][0]))
}

fn layout() -> Layout {
    let grid = (0..SENSORS * TIMES).map(|i| i as f64).collect();
    Layout {
        name: "strain".into(),
        unit: Unit::parse("1").unwrap(),
        axes: vec![Axis::grid("time", grid, Unit::parse("s").unwrap())],
    }
}

fn emulator() -> Box<dyn Emulator> {
    let runs = points(250, 1);
    let responses = Matrix::from_rows(SENSORS * TIMES, runs.iter_rows().map(response));
    let parameter = |(i, range): (usize, &[f64; 2])| Parameter {
        name: format!("x{i}"),
        symbol: format!("x{i}"),
        unit: Unit::parse("1").unwrap(),
        design: Distribution::Uniform(*range),
        prior: Distribution::Uniform(*range),
        reference: None,
    };
    let parameters: Vec<Parameter> = BOX.iter().enumerate().map(parameter).collect();
    let options = PolynomialChaos {
        solver: Solver::LeastSquares,
        degree: Degree::Fixed(7),
        ..PolynomialChaos::default()
    };
    let training = Training {
        parameters: &parameters,
        layouts: &layout().into(),
        points: &runs,
        responses: &responses,
        gradients: None,
    };
    options.fit(&training, &Stream::root(2), &Progress::new(&Silent)).unwrap()
}

/// Replicates with gaps around the emulated response at a point inside the box.
fn measured(emulator: &dyn Emulator, replicates: usize, sd: f64) -> Measurements {
    let truth = emulator.mean(&Matrix::from_rows(3, [&[4e5, 1.1e4, 1500.0][..]]));
    let replicate = |r: usize| {
        let mut rng = Stream::root(3).at(r as u64).generator();
        let value = |(k, m): (usize, &f64)| {
            let y = m + sd * normal(&mut rng);
            (!(k + r).is_multiple_of(17)).then_some(y)
        };
        Replicate::new(r.to_string(), truth.row(0).iter().enumerate().map(value).collect())
    };
    Measurements::new(layout(), (0..replicates).map(replicate).collect())
}

fn likelihood(data: &Measurements, common: &[CommonError]) -> GaussianLikelihood {
    build(data, common, "variance = { half_normal = 1e-6 }")
}

/// Points of the box and its corners, and a variance for each, from far below to far above the noise.
fn cases(sd: f64) -> (Matrix, Matrix) {
    let mut rows: Vec<Vec<f64>> = points(52, 5).iter_rows().map(<[f64]>::to_vec).collect();
    for k in 0..8 {
        rows.push((0..3).map(|i| BOX[i][k >> i & 1]).collect());
    }
    let count = rows.len();
    let theta = Matrix::from_rows(3, rows.iter().map(|r| &r[..]));
    let hyper = Matrix::from_fn(count, 1, |i, _| sd * sd * 10_f64.powi(i as i32 % 7 - 3));
    (theta, hyper)
}

/// `sum_r sum_i log N(y_ir; m_i, v)`, term by term.
fn naive(data: &Measurements, response: &[f64], v: f64) -> f64 {
    let terms = data.replicates.iter().flat_map(|r| r.values.iter().zip(response));
    let one = |(y, m): (&Option<f64>, &f64)| {
        y.map_or(0.0, |y| -0.5 * ((std::f64::consts::TAU * v).ln() + (y - m) * (y - m) / v))
    };
    terms.map(one).sum()
}

#[test]
fn the_fast_form_is_the_sum_over_all_data() {
    let emulator = emulator();
    let linear = emulator.linear().unwrap();
    let sd = 5e-6;
    let data = measured(&*emulator, 20, sd);
    let full = likelihood(&data, &[]);
    let compressed = CompressedGaussian::new(&full, linear).unwrap();
    assert!(compressed.groups[0].squares.is_some());
    let (theta, hyper) = cases(sd);
    let fast = compressed.log_likelihood_at(linear, &theta, &hyper);
    let product = compressed.log_likelihood(&linear.basis(&theta), &hyper);
    for (i, response) in emulator.mean(&theta).iter_rows().enumerate() {
        let expected = naive(&data, response, hyper[(i, 0)]);
        assert!((fast[i] - expected).abs() < 1e-10 * expected.abs(), "{} {expected}", fast[i]);
        assert!((product[i] - expected).abs() < 1e-10 * expected.abs());
    }
}

#[test]
fn common_errors_do_not_change_that() {
    let emulator = emulator();
    let linear = emulator.linear().unwrap();
    let sd = 5e-6;
    let data = measured(&*emulator, 20, sd);
    let mut factor = random_matrix(SENSORS * TIMES, 83, 8);
    for value in factor.as_mut_slice() {
        *value *= 1e-6;
    }
    let common =
        [CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true }];
    let full = likelihood(&data, &common);
    let compressed = CompressedGaussian::new(&full, linear).unwrap();
    assert!(compressed.groups[0].squares.is_some());
    let (theta, hyper) = cases(sd);
    let fast = compressed.log_likelihood_at(linear, &theta, &hyper);
    for (i, response) in emulator.mean(&theta).iter_rows().enumerate() {
        let expected = full.log_likelihood(response, hyper.row(i));
        assert!((fast[i] - expected).abs() < 1e-10 * expected.abs(), "{} {expected}", fast[i]);
        let (by_point, by_variance) = compressed.gradient_at(linear, theta.row(i), hyper.row(i));
        let (by_response, by_hyper) = full.gradient(response, hyper.row(i));
        let jacobian = emulator.jacobian(theta.row(i));
        let chained = lacuna_linalg::transposed_multiply_vector(&jacobian, &by_response);
        for (k, (found, expected)) in by_point.iter().zip(&chained).enumerate() {
            // The change over a thousandth of the box is accurate to the digits of the log density.
            let step = 1e-3 * (BOX[k][1] - BOX[k][0]);
            let scale = fast[i].abs() + (expected * step).abs();
            assert!(((found - expected) * step).abs() < 1e-9 * scale, "{found} {expected}");
        }
        assert!((by_variance[0] - by_hyper[0]).abs() < 1e-9 * by_hyper[0].abs());
    }
}

/// One replicate with noise a million times smaller than the signal: in the expanded square, rounding errors would
/// exceed the smallest residuals.
#[test]
fn exact_data_are_compared_without_expanding_the_square() {
    let emulator = emulator();
    let linear = emulator.linear().unwrap();
    let sd = 1e-10;
    let data = measured(&*emulator, 1, sd);
    let full = likelihood(&data, &[]);
    let compressed = CompressedGaussian::new(&full, linear).unwrap();
    assert!(compressed.groups[0].squares.is_none());
    let theta = Matrix::from_rows(3, [&[4e5, 1.1e4, 1500.0][..], &[4e5, 1.1e4, 1500.001]]);
    let hyper = Matrix::from_fn(2, 1, |_, _| sd * sd);
    let found = compressed.log_likelihood_at(linear, &theta, &hyper);
    for (i, response) in emulator.mean(&theta).iter_rows().enumerate() {
        let expected = naive(&data, response, sd * sd);
        assert!((found[i] - expected).abs() < 1e-8 * expected.abs(), "{} {expected}", found[i]);
    }
}

#[test]
fn points_outside_the_design_are_evaluated_by_the_product() {
    let emulator = emulator();
    let linear = emulator.linear().unwrap();
    let data = measured(&*emulator, 20, 5e-6);
    let full = likelihood(&data, &[]);
    let compressed = CompressedGaussian::new(&full, linear).unwrap();
    let theta = Matrix::from_rows(3, [&[1.2e6, 1.1e4, 1500.0][..], &[4e5, 1.5e4, 1500.0]]);
    let hyper = Matrix::from_fn(2, 1, |_, _| 1e-10);
    let found = compressed.log_likelihood_at(linear, &theta, &hyper);
    assert_eq!(found, compressed.log_likelihood(&linear.basis(&theta), &hyper));
}
