//! Comparison with a peer: the figures of scikit-learn were computed with version 1.9.1 on the same runs.

use lacuna::data::{Axis, Layout, Layouts, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Forward;
use lacuna::run::{Silent, Tasks};
use lacuna_linalg::Matrix;

use super::*;

/// Points of the unit cube by the additive recurrence of Roberts (2018), which is easily repeated in any language.
pub(in crate::surrogates) fn recurrence(skip: usize, count: usize, dimension: usize) -> Matrix {
    let mut root = 2.0_f64;
    for _ in 0..200 {
        root = (1.0 + root).powf(1.0 / (dimension + 1) as f64);
    }
    Matrix::from_fn(count, dimension, |i, k| {
        (0.5 + (skip + i + 1) as f64 / root.powi(k as i32 + 1)).fract()
    })
}

pub(in crate::surrogates) fn unit_parameters(dimension: usize) -> Vec<Parameter> {
    let parameter = |k: usize| Parameter {
        name: format!("x{k}"),
        symbol: format!("x{k}"),
        unit: Unit::dimensionless(),
        design: Distribution::Uniform([0.0, 1.0]),
        prior: Distribution::Uniform([0.0, 1.0]),
        reference: None,
    };
    (1..=dimension).map(parameter).collect()
}

pub(in crate::surrogates) fn layout(outputs: usize) -> Layout {
    let places = (0..outputs).map(|j| j as f64).collect();
    Layout {
        name: "y".into(),
        unit: Unit::dimensionless(),
        axes: vec![Axis::grid("place", places, Unit::dimensionless())],
    }
}

pub(in crate::surrogates) fn rmse(found: &Matrix, exact: &Matrix) -> Vec<f64> {
    let error = |j: usize| {
        let pairs = found.column(j).into_iter().zip(exact.column(j));
        (pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / found.rows() as f64).sqrt()
    };
    (0..found.columns()).map(error).collect()
}

/// Branin's function (Dixon and Szego 1978), with its domain scaled to the unit square.
fn branin(u: &[f64]) -> f64 {
    use std::f64::consts::PI;
    let (x, y) = (15.0 * u[0] - 5.0, 15.0 * u[1]);
    let bent = y - 5.1 / (4.0 * PI * PI) * x * x + 5.0 / PI * x - 6.0;
    bent * bent + 10.0 * (1.0 - 1.0 / (8.0 * PI)) * x.cos() + 10.0
}

/// The function of Ishigami and Homma (1990), with its domain scaled to the unit cube.
pub(in crate::surrogates) fn ishigami(u: &[f64]) -> f64 {
    let x: Vec<f64> = u.iter().map(|u| (2.0 * u - 1.0) * std::f64::consts::PI).collect();
    x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin()
}

/// A function at 100 runs of the recurrence, and at 2000 further points.
pub(in crate::surrogates) struct Case {
    pub parameters: Vec<Parameter>,
    pub layouts: Layouts,
    pub points: Matrix,
    pub responses: Matrix,
    pub fresh: Matrix,
    pub exact: Matrix,
}

impl Case {
    pub fn new(dimension: usize, f: impl Fn(&[f64]) -> f64) -> Self {
        let (points, fresh) = (recurrence(0, 100, dimension), recurrence(100, 2000, dimension));
        let at = |points: &Matrix| Matrix::from_rows(1, points.iter_rows().map(|u| [f(u)]));
        let (responses, exact) = (at(&points), at(&fresh));
        let (parameters, layouts) = (unit_parameters(dimension), layout(1).into());
        Self { parameters, layouts, points, responses, fresh, exact }
    }

    pub fn training(&self) -> Training<'_> {
        let Self { parameters, layouts, points, responses, .. } = self;
        Training { parameters, layouts, points, responses, gradients: None }
    }
}

/// Source: scikit-learn 1.9.1,
/// `GaussianProcessRegressor(ConstantKernel(1, (1e-3, 1e6)) * k, alpha=1e-10, normalize_y=True, n_restarts_optimizer=8, random_state=0)`
/// with `k` of length scales 0.5 between 1e-2 and 1e2. Its noise may be 1e-16 of the process's variance, so that the
/// nugget must be allowed to be as small here.
#[test]
fn errors_are_not_above_those_of_a_peer() {
    let cases = [
        (Case::new(2, branin), [0.038_527, 0.740_454, 0.000_614_06]),
        (Case::new(3, ishigami), [1.153_070, 1.225_075, 0.871_071]),
    ];
    let kernels = [Kernel::Matern52, Kernel::Matern32, Kernel::SquaredExponential];
    for (case, peers) in &cases {
        for (kernel, peer) in kernels.into_iter().zip(peers) {
            let bounds = Bounds { nugget: [1e-14, 1.0], ..Bounds::default() };
            let options = GaussianProcess { kernel, bounds, ..GaussianProcess::default() };
            let emulator = options
                .krige(&case.training(), &Stream::root(1), &Progress::new(&Silent), Tasks::here())
                .unwrap();
            let error = rmse(&emulator.mean(&case.fresh), &case.exact)[0];
            assert!(error < 1.05 * peer, "{kernel:?}: {error} {peer}");
        }
    }
}

/// If the variance is right, about 95 % of 2000 points lie within 1.96 standard errors of the truth; a likelihood
/// estimate from 100 runs of one function is not that accurate.
#[test]
fn the_variance_covers_the_error() {
    for trend in [Trend::Constant, Trend::Linear] {
        let case = Case::new(3, ishigami);
        let options = GaussianProcess { trend, ..GaussianProcess::default() };
        let emulator = options
            .krige(&case.training(), &Stream::root(1), &Progress::new(&Silent), Tasks::here())
            .unwrap();
        let (mean, variance) =
            (emulator.mean(&case.fresh), emulator.variance(&case.fresh).unwrap());
        let inside = (0..2000).filter(|&i| {
            (mean[(i, 0)] - case.exact[(i, 0)]).abs() < 1.96 * variance[(i, 0)].sqrt()
        });
        let share = inside.count() as f64 / 2000.0;
        assert!((0.85..=0.999).contains(&share), "{share}");
    }
}

/// Noise of a known variance must be found by the nugget: nugget times the variance of the process.
#[test]
fn noise_is_found() {
    let mut case = Case::new(2, |u| 3.0 * (4.0 * u[0]).sin() + u[1]);
    let mut rng = Stream::root(3).generator();
    for y in case.responses.as_mut_slice() {
        *y += 0.2 * lacuna::math::random::normal(&mut rng);
    }
    let emulator = GaussianProcess::default()
        .krige(&case.training(), &Stream::root(1), &Progress::new(&Silent), Tasks::here())
        .unwrap();
    // Where runs are dense, the variance of a new run is that of the noise; 100 runs determine it to 1/sqrt(50).
    let variance = emulator.variance(&case.fresh).unwrap();
    let typical = variance.as_slice().iter().sum::<f64>() / 2000.0;
    assert!((0.6..1.5).contains(&(typical / 0.04)), "{typical}");
    assert!(rmse(&emulator.mean(&case.fresh), &case.exact)[0] < 0.1);
    // Left-out runs include their noise.
    let error = emulator.fit_error();
    let left_out: f64 = error.residuals.as_slice().iter().map(|e| e * e).sum::<f64>() / 100.0;
    assert!((0.6..1.6).contains(&(left_out / 0.04)), "{left_out}");
}

#[test]
fn options_are_read_as_written() {
    let read = |text: &str| lacuna::plugin::registry::from_text::<dyn Surrogate>(NAME, text);
    for sound in [
        "nugget = \"estimated\"",
        "nugget = 0",
        "nugget = 1e-6",
        "components = \"none\"",
        "components = { count = 3 }",
        "bounds = { length_scale = [0.1, 10.0] }",
        "approximation = \"automatic\"",
        "approximation = \"exact\"",
        "approximation = { neighbours = 30 }",
    ] {
        assert!(read(sound).is_ok(), "{sound}");
    }
    for wrong in [
        "nugget = \"guessed\"",
        "kernel = \"cubic\"",
        "components = { share = 1 }",
        "approximation = { neighbors = 30 }",
        "approximation = \"neighbours\"",
    ] {
        assert!(read(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn neighbours_are_some_of_the_other_runs() {
    let case = Case::new(2, branin);
    for (neighbours, sound) in [(0, false), (1, true), (99, true), (100, false)] {
        let approximation = Approximation::Neighbours(neighbours);
        assert_eq!(approximation.fault(Some(100)).is_none(), sound, "{neighbours}");
        let options = GaussianProcess { approximation, starts: 1, ..GaussianProcess::default() };
        let fitted = options.krige(
            &case.training(),
            &Stream::root(1),
            &Progress::new(&Silent),
            Tasks::here(),
        );
        assert_eq!(fitted.is_ok(), sound, "{neighbours}");
    }
    assert_eq!(Approximation::Automatic.neighbours(2000), None);
    assert_eq!(Approximation::Automatic.neighbours(2001), Some(100));
    assert_eq!(Approximation::Exact.neighbours(9000), None);
}
