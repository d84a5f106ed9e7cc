//! Simulation-based calibration of every sampler with the discrepancies.
//!
//! Source: Talts, Betancourt, Simpson, Vehtari and Gelman, *Validating Bayesian inference algorithms with
//! simulation-based calibration*, arXiv 1804.06788. Parameters and hyperparameters are drawn from their priors, data
//! simulated by the discrepancy itself; the rank of each drawn value among posterior draws must be uniform. A pair
//! passes if the chi-square test of its least uniform coordinate has p > 0.01, corrected for the number of coordinates.
//! With many pairs some fail by chance; such a pair is repeated once with four times as many simulations and other
//! random numbers, and must then pass: a correct pair fails both with probability 1e-4.
//!
//! Each change runs each sampler with three of the discrepancies, and each of these with at least three samplers;
//! `LACUNA_TRUTH=1` takes all pairs.

use lacuna::data::{Axis, Layout, Measurements, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, Known};
use lacuna::plugin::forward::Linear;
use lacuna::plugin::{Discrepancy, Forward, Likelihood, Target, registry};
use lacuna_engine::posterior::{OfData, Posterior};
use lacuna_linalg::{Matrix, multiply};
use rayon::prelude::*;

use super::runs;

/// Number of draws among which a value is ranked; the ranks are sorted into [`BINS`] bins of equal probability.
const DRAWS: usize = 63;
const BINS: usize = 8;
const SIMULATIONS: u64 = 64;

/// The straight line `y = a + b t` of each sensor, as an emulator with the basis `(1, a, b)`.
struct Line {
    coefficients: Matrix,
}

const TIMES: usize = 5;
const OUTPUTS: usize = 2 * TIMES;

fn time(i: usize) -> f64 {
    (i % TIMES) as f64 / 2.0 - 1.0
}

impl Default for Line {
    fn default() -> Self {
        let coefficient = |k: usize, i: usize| match k {
            0 => 0.0,
            1 => 1.0,
            _ => time(i),
        };
        Self { coefficients: Matrix::from_fn(3, OUTPUTS, coefficient) }
    }
}

impl Forward for Line {
    fn dimension(&self) -> usize {
        2
    }

    fn outputs(&self) -> usize {
        OUTPUTS
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        multiply(&self.basis(points), &self.coefficients)
    }

    fn jacobian(&self, _: &[f64]) -> Matrix {
        Matrix::from_fn(OUTPUTS, 2, |i, j| if j == 0 { 1.0 } else { time(i) })
    }

    fn linear(&self) -> Option<&dyn Linear> {
        Some(self)
    }
}

impl Linear for Line {
    fn coefficients(&self) -> &Matrix {
        &self.coefficients
    }
    fn basis(&self, points: &Matrix) -> Matrix {
        Matrix::from_fn(points.rows(), 3, |i, k| if k == 0 { 1.0 } else { points[(i, k - 1)] })
    }
    fn basis_gradient(&self, _: &[f64]) -> Matrix {
        Matrix::from_fn(3, 2, |k, j| f64::from(u8::from(k == j + 1)))
    }
}

fn layout() -> Layout {
    let times = (0..TIMES).map(|i| i as f64).collect();
    Layout {
        name: "y".into(),
        unit: Unit::parse("m").unwrap(),
        axes: vec![
            Axis::labels("sensor", ["A", "B"]),
            Axis::grid("time", times, Unit::parse("s").unwrap()),
        ],
    }
}

fn parameters() -> Vec<Parameter> {
    let parameter = |name: &str| Parameter {
        name: name.into(),
        symbol: name.into(),
        unit: Unit::dimensionless(),
        design: Distribution::Normal([0.0, 1.0]),
        prior: Distribution::Normal([0.0, 1.0]),
        reference: None,
    };
    vec![parameter("a"), parameter("b")]
}

/// Three replicates with missing values; the values are replaced by simulated ones.
fn pattern() -> Measurements {
    let replicate = |r: usize| {
        Replicate::new(
            format!("p{r}"),
            (0..OUTPUTS).map(|i| (!(i + 2 * r).is_multiple_of(7)).then_some(i as f64)).collect(),
        )
    };
    Measurements::new(layout(), (0..3).map(replicate).collect())
}

fn likelihood(discrepancy: &dyn Discrepancy, data: &Measurements) -> Box<dyn Likelihood> {
    let emulator = CommonError {
        origin: ErrorOrigin::Emulator,
        factor: Matrix::from_fn(OUTPUTS, 1, |i, _| 0.2 * (1.3 * i as f64).sin()).into(),
        predictive: true,
    };
    let slopes = || Ok(Line::default().jacobian(&[]));
    let known = Known { data, common: &[emulator], slopes: &slopes, parameters: &[] };
    discrepancy.likelihood(&known).unwrap_or_else(|stop| panic!("{stop}"))
}

/// Bin of each coordinate's rank in one simulation.
fn bins(sampler: (&str, &str), discrepancy: (&str, &str), stream: &Stream) -> Vec<usize> {
    let built = registry::from_text::<dyn Discrepancy>(discrepancy.0, discrepancy.1);
    let discrepancy = built.unwrap_or_else(|e| panic!("{e}")).plugin;
    let (line, parameters) = (Line::default(), parameters());
    let prior = likelihood(&*discrepancy, &pattern());
    let emulated = OfData::new(&line, Vec::new(), &*prior);
    let truth = Posterior::new(&parameters, emulated).prior_draws(1, &stream.named("truth"));
    let natural = {
        let emulated = OfData::new(&line, Vec::new(), &*prior);
        Posterior::new(&parameters, emulated).natural(truth.row(0))
    };
    let response = line.mean(&Matrix::from_rows(2, [&natural[..2]]));
    let data = prior.simulate(response.row(0), &natural[2..], &stream.named("data"));
    let likelihood = likelihood(&*discrepancy, &data[0]);
    let posterior = Posterior::new(&parameters, OfData::new(&line, Vec::new(), &*likelihood));
    let method = runs::sampler(sampler.0, sampler.1);
    let found = runs::run(&*method, &posterior, &stream.named("run")).draws;
    let points = found.points();
    let chosen: Vec<usize> =
        (0..DRAWS).map(|k| (2 * k + 1) * points.rows() / (2 * DRAWS)).collect();
    let rank = |j: usize| chosen.iter().filter(|&&i| points[(i, j)] < truth[(0, j)]).count();
    (0..truth.columns()).map(|j| rank(j) * BINS / (DRAWS + 1)).collect()
}

/// Corrected p-value of a pair over `count` simulations.
fn p_value(sampler: (&str, &str), discrepancy: (&str, &str), count: u64, stream: &Stream) -> f64 {
    let each: Vec<Vec<usize>> =
        (0..count).into_par_iter().map(|k| bins(sampler, discrepancy, &stream.at(k))).collect();
    let expected = count as f64 / BINS as f64;
    let coordinates = each[0].len();
    let chi_square = |j: usize| -> f64 {
        let mut counts = [0.0; BINS];
        for bins in &each {
            counts[bins[j]] += 1.0;
        }
        counts.iter().map(|n| (n - expected).powi(2) / expected).sum()
    };
    let law = Distribution::Gamma([0.5 * (BINS - 1) as f64, 2.0]);
    let smallest =
        (0..coordinates).map(|j| 1.0 - law.cdf(chi_square(j))).fold(f64::INFINITY, f64::min);
    (coordinates as f64 * smallest).min(1.0)
}

/// Tests a sampler with each of these discrepancies.
fn judge_with(sampler: (&str, &str), discrepancies: &[(&str, &str)]) {
    let mut failed = Vec::new();
    for &discrepancy in discrepancies {
        let stream = Stream::root(20_180_418).named(sampler.0).named(discrepancy.1);
        let first = p_value(sampler, discrepancy, SIMULATIONS, &stream.named("first"));
        if first > 0.01 {
            continue;
        }
        let second = p_value(sampler, discrepancy, 4 * SIMULATIONS, &stream.named("second"));
        if second <= 0.01 {
            let names = format!("{} with {} ({})", sampler.0, discrepancy.0, discrepancy.1);
            failed.push(format!("{names}: p = {first:.1e}, then {second:.1e}"));
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// Tests the sampler of this number, from which its three discrepancies follow.
fn judge(number: usize, sampler: (&str, &str)) {
    let all = DISCREPANCIES.len();
    let some = [0, 2, 5].map(|step| DISCREPANCIES[(number + step) % all]);
    judge_with(sampler, if runs::every_one() { &DISCREPANCIES } else { &some });
}

/// All discrepancies, with priors that do not depend on the data.
const DISCREPANCIES: [(&str, &str); 7] = [
    ("gaussian", "variance = { log_normal = [-1.0, 0.7] }"),
    ("gaussian", "variance = { log_normal = [-1.0, 0.7] }\nby = \"sensor\""),
    ("gaussian", "variance = { known = 0.3 }"),
    (
        "multiplicative_gaussian",
        "relative = { log_normal = [-1.0, 0.5] }\nfloor = { log_normal = [-1.0, 0.5] }",
    ),
    ("student_t", "scale = { log_normal = [-0.5, 0.5] }"),
    (
        "autoregressive",
        "variance = { log_normal = [-1.0, 0.7] }\ncorrelation_time = { log_normal = [0.0, 0.7] }",
    ),
    (
        "gaussian_process",
        "bias = { log_normal = [-1.0, 0.5] }\ncorrelation_length = { log_normal = [0.5, 0.5] }\n\
         variance = { log_normal = [-1.0, 0.7] }",
    ),
];

#[test]
fn affine_invariant_ensemble() {
    judge(0, ("affine_invariant_ensemble", "walkers = 24\nsteps = 600"));
}

#[test]
fn metropolis() {
    judge(1, ("metropolis", "steps = 1500"));
}

#[test]
fn adaptive_metropolis() {
    judge(2, ("adaptive_metropolis", "steps = 2000\nwarm_up = 500"));
}

#[test]
fn delayed_rejection_adaptive_metropolis() {
    let options = "steps = 1500\nwarm_up = 500";
    judge(3, ("delayed_rejection_adaptive_metropolis", options));
}

#[test]
fn differential_evolution() {
    judge(4, ("differential_evolution", "steps = 2000\nwarm_up = 500"));
}

#[test]
fn hamiltonian() {
    judge(5, ("hamiltonian", "steps = 300\nwarm_up = 150"));
}

#[test]
fn no_u_turn() {
    judge(6, ("no_u_turn", "steps = 300\nwarm_up = 150"));
}

#[test]
fn sequential_monte_carlo() {
    judge(7, ("sequential_monte_carlo", "particles = 300"));
}

#[test]
fn nested() {
    judge(8, ("nested", "live = 100"));
}

/// An approximate method: calibrated if its Pareto k-hat allows its draws to be corrected.
#[test]
fn variational() {
    judge_with(("variational", "draws = 1000"), &DISCREPANCIES[..3]);
}
