//! Densities with known moments, and complete runs on them, for the tests of samplers that use gradients.

use lacuna::data::{Draws, Layout, Unit};
use lacuna::diagnose::chains::mcse_mean;
use lacuna::math::distribution::Distribution;
use lacuna::math::moments::Moments;
use lacuna::math::random::{Stream, normal};
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::sampler::State;
use lacuna::plugin::{Component, Context, Sampler, Target};
use lacuna::text::{Complaints, Problems, Sources};
use lacuna_linalg::{Cholesky, Matrix, multiply_vector};
use rand::rngs::ChaCha8Rng;
use serde::de::DeserializeOwned;

use super::metric::Metric;
use super::{Flow, Point, Transition};

/// A density given by a function that returns its logarithm and gradient.
pub(crate) struct Law<F> {
    pub bounds: Vec<(f64, f64)>,
    /// Mean and standard deviation of the normal prior of each coordinate; prior draws outside the bounds are
    /// repeated.
    pub prior: Vec<[f64; 2]>,
    pub function: F,
}

impl<F: Fn(&[f64]) -> (f64, Vec<f64>) + Sync> Law<F> {
    /// Returns a density without bounds.
    pub fn free(prior: Vec<[f64; 2]>, function: F) -> Self {
        Self { bounds: vec![(f64::NEG_INFINITY, f64::INFINITY); prior.len()], prior, function }
    }
}

impl<F: Fn(&[f64]) -> (f64, Vec<f64>) + Sync> Target for Law<F> {
    fn dimension(&self) -> usize {
        self.prior.len()
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|point| self.gradient(point).0).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let laws = || self.prior.iter().map(|&prior| Distribution::Normal(prior));
        let row = |p: &[f64]| laws().zip(p).map(|(law, &x)| law.log_density(x)).sum();
        points.iter_rows().map(row).collect()
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let inside = point.iter().zip(&self.bounds).all(|(x, (lo, hi))| x >= lo && x <= hi);
        if inside { (self.function)(point) } else { (f64::NEG_INFINITY, vec![0.0; point.len()]) }
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.bounds.clone()
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, self.prior.len(), |_, j| {
            loop {
                let x = self.prior[j][0] + self.prior[j][1] * normal(&mut rng);
                if x >= self.bounds[j].0 && x <= self.bounds[j].1 {
                    return x;
                }
            }
        })
    }
}

/// The self-test of UQLab: prior N(7, variance 2), data 9.1241 and 8.151 with variance 3. The posterior is normal
/// with mean 7.935743 and variance 0.857143.
pub(crate) fn conjugate() -> Law<impl Fn(&[f64]) -> (f64, Vec<f64>) + Sync> {
    Law::free(vec![[7.0, 2.0_f64.sqrt()]], |x: &[f64]| {
        let misfit = (9.1241 - x[0]).powi(2) + (8.151 - x[0]).powi(2);
        let slope = (9.1241 - x[0] + 8.151 - x[0]) / 3.0 - 0.5 * (x[0] - 7.0);
        (-0.25 * (x[0] - 7.0).powi(2) - misfit / 6.0, vec![slope])
    })
}

/// Returns the Kullback-Leibler divergence of the normal distribution with the moments of the draws from the
/// posterior of [`conjugate`].
pub(crate) fn conjugate_divergence(draws: &[f64]) -> f64 {
    use lacuna::math::moments::{mean, variance};
    let ratio = variance(draws) / 0.857_143;
    0.5 * (ratio - 1.0 - ratio.ln() + (mean(draws) - 7.935_743_f64).powi(2) / 0.857_143)
}

/// Returns the scale of coordinate `j` of [`scaled`]: from 1e-3 to 1e3.
pub(crate) fn scale(j: usize) -> f64 {
    10.0_f64.powf(-3.0 + 6.0 * j as f64 / 9.0)
}

/// A normal density in ten coordinates with standard deviations [`scale`] and means `10 j` times these; correlations
/// are 0.8 to the power of the distance (an autoregressive series). The prior is a thousand times wider.
pub(crate) fn scaled() -> Law<impl Fn(&[f64]) -> (f64, Vec<f64>) + Sync> {
    let correlation = Matrix::from_fn(10, 10, |i, j| 0.8_f64.powi(i.abs_diff(j) as i32));
    let precision = Cholesky::new(&correlation).unwrap().inverse();
    let prior = (0..10).map(|j| [0.0, 1e3 * scale(j)]).collect();
    Law::free(prior, move |x: &[f64]| {
        let z: Vec<f64> =
            x.iter().enumerate().map(|(j, x)| x / scale(j) - 10.0 * j as f64).collect();
        let pull = multiply_vector(&precision, &z);
        let value = -0.5 * z.iter().zip(&pull).map(|(z, p)| z * p).sum::<f64>();
        (value, pull.iter().enumerate().map(|(j, p)| -p / scale(j)).collect())
    })
}

/// A density of Rosenbrock's shape: x ~ N(1, 1) and y | x ~ N(x^2, 0.1), so that E y = 2, var y = 6.1.
pub(crate) fn banana() -> Law<impl Fn(&[f64]) -> (f64, Vec<f64>) + Sync> {
    Law::free(vec![[1.0, 0.5], [1.0, 0.5]], |x: &[f64]| {
        let off = x[1] - x[0] * x[0];
        let value = -0.5 * (x[0] - 1.0).powi(2) - 5.0 * off * off;
        (value, vec![1.0 - x[0] + 20.0 * off * x[0], -10.0 * off])
    })
}

/// The product of a gamma density with shape 3 and rate 2e4 and a beta density with shapes 2 and 5 on (100, 200):
/// means 1.5e-4 and 128.571, standard deviations 8.660e-5 and 15.97.
pub(crate) fn bounded() -> Law<impl Fn(&[f64]) -> (f64, Vec<f64>) + Sync> {
    let function = |x: &[f64]| {
        let (below, above) = (x[1] - 100.0, 200.0 - x[1]);
        let value = 2.0 * x[0].ln() - 2e4 * x[0] + below.ln() + 4.0 * above.ln();
        (value, vec![2.0 / x[0] - 2e4, 1.0 / below - 4.0 / above])
    };
    Law {
        bounds: vec![(0.0, f64::INFINITY), (100.0, 200.0)],
        prior: vec![[1e-3, 1e-3], [150.0, 50.0]],
        function,
    }
}

/// Neal's funnel with nine coordinates whose scale is `exp(v / 2)` with v ~ N(0, 9).
pub(crate) fn funnel() -> Law<impl Fn(&[f64]) -> (f64, Vec<f64>) + Sync> {
    Law::free(vec![[0.0, 1.0]; 10], |x: &[f64]| {
        let squares: f64 = x[1..].iter().map(|x| x * x).sum();
        let weight = (-x[0]).exp();
        let value = -x[0] * x[0] / 18.0 - 0.5 * squares * weight - 4.5 * x[0];
        let mut gradient: Vec<f64> = x.iter().map(|x| -x * weight).collect();
        gradient[0] = -x[0] / 9.0 + 0.5 * squares * weight - 4.5;
        (value, gradient)
    })
}

/// Runs a sampler from prior draws to its end; returns the draws after the warm-up, and the last state.
pub(crate) fn run(sampler: &dyn Sampler, target: &dyn Target, seed: u64) -> (Draws, State) {
    let root = Stream::root(seed);
    let plan = sampler.plan(target.dimension());
    let points = target.prior_draws(plan.chains, &root.named("start"));
    let mut state = sampler.start(target, points).unwrap();
    let mut kept = Vec::new();
    for step in 0..plan.steps {
        sampler.step(target, &mut state, &root.named("step").at(step as u64)).unwrap();
        if step >= plan.warm_up {
            kept.push((state.points.clone(), state.log_density.clone()));
        }
    }
    let names = (0..target.dimension()).map(|j| format!("x{j}")).collect();
    (Draws::from_steps(names, &kept), state)
}

/// Asserts that the mean of `f` over the draws is within four Monte Carlo errors of `expected`, and that the error is
/// below a tenth of `scale`.
pub(crate) fn assert_mean(
    draws: &Draws,
    what: &str,
    expected: f64,
    scale: f64,
    f: impl Fn(&[f64]) -> f64,
) {
    let values: Vec<Vec<f64>> = (0..draws.chains)
        .map(|chain| (0..draws.steps).map(|step| f(draws.point(chain, step))).collect())
        .collect();
    let mean = values.iter().flatten().sum::<f64>() / draws.len() as f64;
    let error = mcse_mean(&values);
    assert!((mean - expected).abs() < 4.0 * error, "{what}: {mean} +- {error}, not {expected}");
    assert!(error < 0.1 * scale, "{what}: known to {error} only");
}

/// Asserts that runs on the scaled and on the bounded density reproduce their moments.
pub(crate) fn assert_moments(sampler: &dyn Sampler) {
    let (draws, state) = run(sampler, &scaled(), 1);
    for j in 0..10 {
        let z = move |x: &[f64], j: usize| x[j] / scale(j) - 10.0 * j as f64;
        assert_mean(&draws, &format!("mean {j}"), 0.0, 1.0, |x| z(x, j));
        assert_mean(&draws, &format!("variance {j}"), 1.0, 1.0, |x| z(x, j).powi(2));
        if j > 0 {
            assert_mean(&draws, &format!("covariance {j}"), 0.8, 1.0, |x| z(x, j) * z(x, j - 1));
        }
    }
    assert_eq!(sampler.doubts(&state), Vec::<String>::new());
    let (draws, _) = run(sampler, &bounded(), 2);
    assert_mean(&draws, "gamma mean", 1.5e-4, 1e-4, |x| x[0]);
    assert_mean(&draws, "gamma variance", 7.5e-9, 1e-8, |x| (x[0] - 1.5e-4).powi(2));
    assert_mean(&draws, "beta mean", 100.0 + 200.0 / 7.0, 10.0, |x| x[1]);
    let variance = 1e4 * 10.0 / (49.0 * 8.0);
    assert_mean(&draws, "beta variance", variance, variance, |x| {
        (x[1] - 100.0 - 200.0 / 7.0).powi(2)
    });
}

/// Asserts that a run on the curved ridge reproduces its moments.
pub(crate) fn assert_banana(sampler: &dyn Sampler) {
    let (draws, _) = run(sampler, &banana(), 3);
    assert_mean(&draws, "mean of x", 1.0, 1.0, |x| x[0]);
    assert_mean(&draws, "variance of x", 1.0, 1.0, |x| (x[0] - 1.0).powi(2));
    assert_mean(&draws, "mean of y", 2.0, 2.5, |x| x[1]);
    assert_mean(&draws, "variance of y", 6.1, 10.0, |x| (x[1] - 2.0).powi(2));
}

/// Returns the median of [`conjugate_divergence`] over twenty seeds.
pub(crate) fn median_divergence(draws_of: impl Fn(u64) -> Vec<f64>) -> f64 {
    let mut all: Vec<f64> = (0..20).map(|seed| conjugate_divergence(&draws_of(seed))).collect();
    all.sort_by(f64::total_cmp);
    0.5 * (all[9] + all[10])
}

/// Asserts that a transition leaves the density of the curved ridge invariant: independent draws of it stay
/// independent draws, so that the moments of many chains after a few steps have only the error of independent draws.
pub(crate) fn assert_stationary(
    transition: impl Fn(&Flow<'_>, &Point, &mut ChaCha8Rng) -> Transition,
) {
    const CHAINS: usize = 20_000;
    let law = banana();
    let target = Unconstrained::new(&law);
    let metric = Metric::Dense(Matrix::from_rows(2, [[0.8, 0.0], [0.9, 1.2]]));
    let flow = Flow { target: &target, metric: &metric };
    let mut sums = [Moments::new(5), Moments::new(5)];
    for chain in 0..CHAINS {
        let mut rng = Stream::root(8).at(chain as u64).generator();
        let x = 1.0 + normal(&mut rng);
        let y = x * x + 0.1_f64.sqrt() * normal(&mut rng);
        let mut point = Point::at(&target, vec![x, y]);
        for sum in &mut sums {
            let (x, y) = (point.place[0], point.place[1]);
            let ridge = y - x * x;
            sum.add(&[x, (x - 1.0).powi(2), y, (ridge * ridge), (x - 1.0) * ridge]);
            (0..4).for_each(|_| point = transition(&flow, &point, &mut rng).point);
        }
    }
    for (k, expected) in [1.0, 1.0, 2.0, 0.1, 0.0].into_iter().enumerate() {
        let error = sums[1].sd()[k] / (CHAINS as f64).sqrt();
        let found = sums[1].mean()[k];
        assert!((found - expected).abs() < 4.0 * error, "{k}: {found} +- {error}");
    }
}

/// Returns the problems a component reports for options written as TOML.
pub(crate) fn complaints_about<C: Component + DeserializeOwned>(text: &str) -> String {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let source = sources.add_argument("sampler", text.to_owned());
    let node = lacuna::text::read::read(source, &sources, &mut problems).unwrap();
    let component: C = lacuna::text::decode(&node, &mut problems).unwrap();
    let layout = Layout { name: String::new(), unit: Unit::parse("1").unwrap(), axes: Vec::new() };
    let directory = std::path::Path::new(".");
    let context = Context::new(directory, &[], &layout);
    component.check(&context, &mut Complaints::new(&node, &mut problems));
    problems.render(&sources)
}
