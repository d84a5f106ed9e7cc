//! Comparison with exact processes on published functions, and cases for which the process is no good description.

use lacuna::data::{Layouts, Parameter};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Emulator, Forward};
use lacuna::run::{Progress, Silent, Tasks};
use lacuna_linalg::Matrix;

use super::super::super::{Approximation, Bounds, Kernel, Kriging, Nugget};
use super::functions::{borehole, circuit, friedman, piston, wing_weight};
use crate::surrogates::gaussian_process::GaussianProcess;
use crate::surrogates::gaussian_process::tests::{
    ishigami, layout, recurrence, rmse, unit_parameters,
};

/// Number of points at which errors are computed.
const FRESH: usize = 1000;

/// A function at some runs, and at further points.
struct Trial {
    parameters: Vec<Parameter>,
    layouts: Layouts,
    points: Matrix,
    responses: Matrix,
    fresh: Matrix,
    exact: Matrix,
}

impl Trial {
    fn new(dimension: usize, runs: usize, f: impl Fn(&[f64]) -> f64) -> Self {
        let points = recurrence(0, runs, dimension);
        Self::at(points, f)
    }

    fn at(points: Matrix, f: impl Fn(&[f64]) -> f64) -> Self {
        let dimension = points.columns();
        let fresh = recurrence(20_000, FRESH, dimension);
        let of = |points: &Matrix| Matrix::from_rows(1, points.iter_rows().map(|u| [f(u)]));
        let (responses, exact) = (of(&points), of(&fresh));
        let (parameters, layouts) = (unit_parameters(dimension), layout(1).into());
        Self { parameters, layouts, points, responses, fresh, exact }
    }

    fn noisy(mut self, sd: f64) -> Self {
        let mut rng = Stream::root(3).generator();
        for y in self.responses.as_mut_slice() {
            *y += sd * normal(&mut rng);
        }
        self
    }

    fn fit(&self, approximation: Approximation) -> Kriging {
        self.fit_with(&GaussianProcess { approximation, ..GaussianProcess::default() })
    }

    fn fit_with(&self, plugin: &GaussianProcess) -> Kriging {
        let Self { parameters, layouts, points, responses, .. } = self;
        let training = Training { parameters, layouts, points, responses, gradients: None };
        plugin.krige(&training, &Stream::root(1), &Progress::new(&Silent), Tasks::here()).unwrap()
    }

    fn error(&self, emulator: &Kriging) -> f64 {
        rmse(&emulator.mean(&self.fresh), &self.exact)[0]
    }

    /// Root mean square of the errors in units of their standard deviations, with noise of a known variance added.
    fn standardised(&self, emulator: &Kriging, noise: f64) -> f64 {
        let (mean, variance) =
            (emulator.mean(&self.fresh), emulator.variance(&self.fresh).unwrap());
        let square =
            |i: usize| ((mean[(i, 0)] - self.exact[(i, 0)]).powi(2) + noise) / variance[(i, 0)];
        ((0..FRESH).map(square).sum::<f64>() / FRESH as f64).sqrt()
    }

    /// Returns the errors of the approximation and of the exact process.
    fn both(&self, neighbours: usize) -> [f64; 2] {
        [Approximation::Neighbours(neighbours), Approximation::Exact]
            .map(|approximation| self.error(&self.fit(approximation)))
    }
}

/// Six hundred runs, of which a sixth are neighbours: the error is at most a tenth above that of the exact process.
#[test]
fn errors_are_those_of_the_exact_process() {
    for (name, trial) in [
        ("borehole", Trial::new(8, 600, borehole)),
        ("circuit", Trial::new(6, 600, circuit)),
        ("friedman", Trial::new(10, 600, friedman)),
        ("ishigami", Trial::new(3, 600, ishigami)),
        ("piston", Trial::new(7, 600, piston)),
        ("wing weight", Trial::new(10, 600, wing_weight)),
    ] {
        let [found, exact] = trial.both(100);
        println!("{name}: {found:.4e}, exact {exact:.4e}");
        assert!(found < 1.1 * exact, "{name}: {found} {exact}");
    }
}

#[test]
fn more_runs_are_better_than_the_most_that_are_fitted_exactly() {
    let f = |u: &[f64]| ishigami(u);
    let many = Trial::new(3, 4000, f);
    let few = Trial::new(3, 1000, f);
    let emulator = many.fit(Approximation::Automatic);
    assert_eq!(emulator.fields[0].choice.neighbours, Some(100));
    let (found, exact) = (many.error(&emulator), few.error(&few.fit(Approximation::Exact)));
    println!("4000 runs: {found:.3e}, 1000 runs: {exact:.3e}");
    assert!(found < 0.4 * exact, "{found} {exact}");
    let standardised = many.standardised(&emulator, 0.0);
    assert!((0.2..1.2).contains(&standardised), "{standardised}");
}

/// Noise is found as the nugget, and predictions of new runs are as wrong as they say: 1500 runs determine the standard
/// deviation of the noise to 2 %.
#[test]
fn noise_is_found() {
    let trial = Trial::new(3, 1500, |u| 3.0 * (4.0 * u[0]).sin() + u[1] * u[2]).noisy(0.5);
    let emulator = trial.fit(Approximation::Neighbours(30));
    let exact = trial.fit(Approximation::Exact);
    let standardised = trial.standardised(&emulator, 0.25);
    assert!((0.93..1.05).contains(&standardised), "{standardised}");
    let (found, exact) = (trial.error(&emulator), trial.error(&exact));
    println!("noise: {found:.4e}, exact {exact:.4e}, standardised {standardised:.3}");
    assert!(found < 1.2 * exact, "{found} {exact}");
}

/// Every run is there three times, on a design in clusters; the response is that of a smooth function without noise.
#[test]
fn duplicates_do_not_break_it() {
    let base = recurrence(0, 200, 2);
    let points = Matrix::from_fn(600, 2, |i, k| {
        let (cluster, shift) = (base[(i % 200 / 10 * 10, k)], base[(i % 200, k)]);
        0.9 * cluster + 0.1 * shift
    });
    let f = |u: &[f64]| (4.0 * u[0]).sin() + u[1] * u[1];
    let trial = Trial::at(points, f);
    for nugget in [Nugget::default(), Nugget::Fixed(0.0)] {
        let plugin =
            |approximation| GaussianProcess { nugget, approximation, ..GaussianProcess::default() };
        let found = trial.fit_with(&plugin(Approximation::Neighbours(30)));
        let exact = trial.fit_with(&plugin(Approximation::Exact));
        let (a, b) = (trial.error(&found), trial.error(&exact));
        println!("duplicates: {a:.3e}, exact {b:.3e}, nugget {:.1e}", found.fields[0].nugget);
        assert!(a < 2.0 * b + 1e-4, "{a} {b}");
        let variance = found.variance(&trial.fresh).unwrap();
        assert!(variance.as_slice().iter().all(|v| *v > 0.0 && v.is_finite()));
    }
}

/// A step is no realisation of the process: the error is large near it for both, and no larger for the approximation.
#[test]
fn a_step_is_no_worse_than_for_the_exact_process() {
    let step = |u: &[f64]| if u[0] + 0.3 * u[1] > 0.6 { 1.0 } else { 0.0 };
    let trial = Trial::new(3, 800, step);
    let [found, exact] = trial.both(60);
    println!("step: {found:.3e}, exact {exact:.3e}");
    assert!(found < 1.1 * exact, "{found} {exact}");
}

/// Squared exponentials are nearly dependent: their weights are found with a jitter if need be.
#[test]
fn smooth_kernels_are_solved() {
    let trial = Trial::new(2, 900, |u| (5.0 * u[0]).sin() * (3.0 * u[1]).cos());
    let kernel = Kernel::SquaredExponential;
    let approximation = Approximation::Neighbours(60);
    let emulator =
        trial.fit_with(&GaussianProcess { kernel, approximation, ..GaussianProcess::default() });
    let error = trial.error(&emulator);
    println!("squared exponential: {error:.2e}, nugget {:.1e}", emulator.fields[0].nugget);
    assert!(error < 1e-4, "{error}");
}

/// The nugget is bounded so that differences of the mean, with which its derivatives are compared, are not those of
/// rounding errors.
#[test]
fn it_keeps_the_contract() {
    for neighbours in [12, 59] {
        let approximation = Approximation::Neighbours(neighbours);
        let bounds = Bounds { nugget: [1e-9, 1.0], ..Bounds::default() };
        let plugin = GaussianProcess { approximation, bounds, ..GaussianProcess::default() };
        assert_eq!(lacuna_contract::surrogate("gaussian_process", &plugin), Ok(()));
    }
}

/// Thousands of runs are shared out among the threads, and give the same bits on any number of them.
#[test]
fn threads_do_not_change_bits() {
    let trial = Trial::new(3, 2100, ishigami);
    let fit = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| trial.fit(Approximation::Neighbours(20)))
    };
    let (one, emulator) = (fit(1).save().unwrap(), fit(3));
    assert!(one == emulator.save().unwrap());
    let read = Kriging::from_bytes("gaussian_process", &one).unwrap();
    assert_eq!(read, emulator);
    assert_eq!(read.tables(), emulator.tables());
}
