//! Samplers against densities with known moments.

mod proof;

use lacuna::data::Draws;
use lacuna::diagnose::{autocorrelation, chains};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::{Sampler, Target};
use lacuna_linalg::Matrix;

/// A density given by a function, with independent priors; its gradient is taken by differences.
pub(super) struct Density<F> {
    pub priors: Vec<Distribution>,
    pub bounds: Vec<(f64, f64)>,
    pub function: F,
}

impl<F: Fn(&[f64]) -> f64 + Sync> Density<F> {
    /// Returns a density without bounds.
    pub fn new(priors: Vec<Distribution>, function: F) -> Self {
        let bounds = vec![(f64::NEG_INFINITY, f64::INFINITY); priors.len()];
        Self { priors, bounds, function }
    }
}

impl<F: Fn(&[f64]) -> f64 + Sync> Target for Density<F> {
    fn dimension(&self) -> usize {
        self.priors.len()
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(&self.function).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let of = |p: &[f64]| self.priors.iter().zip(p).map(|(law, &x)| law.log_density(x)).sum();
        points.iter_rows().map(of).collect()
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let by = |j: usize| {
            let (low, high) = self.bounds[j];
            let h = 1e-5 * self.priors[j].sd().min(1e3);
            let at = |x: f64| {
                let mut moved = point.to_vec();
                moved[j] = x.clamp(low, high);
                ((self.function)(&moved), moved[j])
            };
            let ((above, right), (below, left)) = (at(point[j] + h), at(point[j] - h));
            (above - below) / (right - left)
        };
        ((self.function)(point), (0..point.len()).map(by).collect())
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.bounds.clone()
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, self.priors.len(), |_, j| self.priors[j].sample(&mut rng))
    }
}

/// Runs a sampler from draws of the prior to its end; returns the draws after the warm-up and after the first
/// quarter.
pub(super) fn run(sampler: &dyn Sampler, target: &dyn Target, seed: u64) -> Draws {
    let plan = sampler.plan(target.dimension());
    let root = Stream::root(seed);
    let points = target.prior_draws(plan.chains, &root.named("start"));
    let mut state = sampler.start(target, points).unwrap();
    let mut kept = Vec::new();
    for step in 0..plan.steps {
        sampler.step(target, &mut state, &root.named("step").at(step as u64)).unwrap();
        if step >= plan.warm_up.max(plan.steps / 4) {
            kept.push((state.points.clone(), state.log_density.clone()));
        }
    }
    let names = (0..target.dimension()).map(|j| format!("x{j}")).collect();
    Draws::from_steps(names, &kept)
}

/// Returns the values of a function of the draws, chain by chain.
pub(super) fn values(draws: &Draws, f: impl Fn(&[f64]) -> f64) -> Vec<Vec<f64>> {
    let of = |chain| (0..draws.steps).map(|step| f(draws.point(chain, step))).collect();
    (0..draws.chains).map(of).collect()
}

/// Asserts that the mean of `f` over the draws is within four Monte Carlo errors of `expected`, and that this error
/// is below `largest`.
pub(super) fn assert_mean(
    (what, draws, ensemble): (&str, &Draws, bool),
    expected: f64,
    largest: f64,
    f: impl Fn(&[f64]) -> f64,
) {
    let values = values(draws, f);
    let mean = values.iter().flatten().sum::<f64>() / draws.len() as f64;
    let error = if ensemble {
        autocorrelation::ensemble_error(&values)
    } else {
        chains::mcse_mean(&values)
    };
    assert!((mean - expected).abs() < 4.0 * error, "{what}: {mean} +- {error}, not {expected}");
    assert!(error < largest, "{what}: known to {error} only");
}
