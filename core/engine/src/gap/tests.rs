//! A straight line with normal priors: fits, evidence and proof against their closed forms.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Layout, Layouts, Measurements, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Forward;
use lacuna_linalg::Matrix;

use super::experiment::Experiment;
use super::noise::{Autoregression, CurveNoise, Noise, Origin, ReplicateVariation};
use super::prove::prove;
use super::search::log_evidence;
use super::system::System;
use super::system::fit::fit;
use super::system::whitener::Whitener;

const TIMES: usize = 12;
const REPLICATES: usize = 5;
const NOISE: f64 = 0.3;

/// A response of two parameters at a time, with its slopes.
struct MeasuredCurve(fn([f64; 2], f64) -> (f64, [f64; 2]));

impl MeasuredCurve {
    fn at(&self, point: &[f64], i: usize) -> (f64, [f64; 2]) {
        self.0([point[0], point[1]], i as f64)
    }
}

impl Forward for MeasuredCurve {
    fn dimension(&self) -> usize {
        2
    }
    fn outputs(&self) -> usize {
        TIMES
    }
    fn mean(&self, points: &Matrix) -> Matrix {
        let response = |p: &[f64]| (0..TIMES).map(|i| self.at(p, i).0).collect::<Vec<_>>();
        Matrix::from_rows(TIMES, points.iter_rows().map(response))
    }
    fn jacobian(&self, point: &[f64]) -> Matrix {
        Matrix::from_fn(TIMES, 2, |i, j| self.at(point, i).1[j])
    }
}

/// `y = a + b t`.
const LINE: MeasuredCurve = MeasuredCurve(|[a, b], t| (a + b * t, [1.0, t]));

/// `y = a exp(-b t)`.
const DECAY: MeasuredCurve = MeasuredCurve(|[a, b], t| {
    let e = (-b * t).exp();
    (a * e, [e, -a * t * e])
});

fn line(a: f64, b: f64) -> Vec<f64> {
    (0..TIMES).map(|t| a + b * t as f64).collect()
}

fn layouts() -> Layouts {
    let times = (0..TIMES).map(|t| t as f64).collect();
    let axes = vec![Axis::grid("time", times, Unit::parse("s").unwrap())];
    Layout { name: "y".into(), unit: Unit::dimensionless(), axes }.into()
}

fn parameters() -> Vec<Parameter> {
    let parameter = |name: &str| {
        let law = Distribution::Normal([0.5, 2.0]);
        Parameter {
            name: name.into(),
            symbol: name.into(),
            unit: Unit::dimensionless(),
            design: law.clone(),
            prior: law,
            reference: None,
        }
    };
    vec![parameter("a"), parameter("b")]
}

/// White noise of known size.
fn white() -> Noise {
    let curve = CurveNoise {
        sd: NOISE,
        memory: Autoregression::white(),
        level: 0.0,
        wander: ReplicateVariation::default(),
        profile: vec![1.0; TIMES],
    };
    Noise {
        curves: vec![curve],
        shared: vec![ReplicateVariation::default()],
        across: vec![None],
        origins: vec![Origin::Stated],
    }
}

fn data(seed: u64, truth: &[f64], count: usize) -> Measurements {
    let replicate = |r: usize| {
        let mut rng = Stream::root(seed).at(r as u64).generator();
        let values = truth.iter().map(|y| Some(y + NOISE * normal(&mut rng))).collect();
        Replicate::new(r.to_string(), values)
    };
    let layout = layouts().blocks[0].clone();
    Measurements::new(layout, (0..count).map(replicate).collect())
}

/// Bayesian linear regression: posterior precision `J'J R / s^2 + 1 / v`, evidence of the means
/// `N(m0, s^2 / R + J v J')` (O'Hagan and Forster, Kendall's Advanced Theory of Statistics 2B, section 11.3).
#[test]
fn a_line_is_fitted_and_weighed_as_its_closed_form() {
    let (layouts, parameters) = (layouts(), parameters());
    let measured = data(7, &line(1.0, -0.4), REPLICATES).into();
    let experiment = Experiment::new(&layouts, &parameters, &LINE, &measured);
    let (_, means) = experiment.means();
    let whitener = Whitener::new(&experiment, &white(), &means);
    let system = System::new(&experiment, Vec::new());
    let found = fit(&system, &whitener, &means, &[3.0, 3.0]);
    let weight = REPLICATES as f64 / (NOISE * NOISE);
    let sum = |f: &dyn Fn(f64) -> f64| (0..TIMES).map(|t| f(t as f64)).sum::<f64>();
    let prior = 1.0 / 4.0;
    let [p, q, r] = [sum(&|_| 1.0), sum(&|t| t), sum(&|t| t * t)].map(|s| weight * s);
    let (p, r) = (p + prior, r + prior);
    let right = |f: &dyn Fn(f64) -> f64| {
        weight * (0..TIMES).map(|t| f(t as f64) * means[t]).sum::<f64>() + prior * 0.5
    };
    let (x, y) = (right(&|_| 1.0), right(&|t| t));
    let determinant = p * r - q * q;
    let exact = [(r * x - q * y) / determinant, (p * y - q * x) / determinant];
    for (found, exact) in found.at.point.iter().zip(exact) {
        assert!((found - exact).abs() < 1e-6, "{found} {exact}");
    }
    let sd = found.sd();
    assert!((sd[0] - (r / determinant).sqrt()).abs() < 1e-9);
    assert!((sd[1] - (p / determinant).sqrt()).abs() < 1e-9);
    // What the noise alone decides is left out: the integral of exp(-|z|^2 / 2) times the prior. With the precision
    // matrix A it is the maximum times 2 pi / sqrt(|A|).
    let log_maximum = found.log_density;
    let exact = log_maximum + std::f64::consts::TAU.ln() - 0.5 * determinant.ln();
    assert!((found.log_evidence() - exact).abs() < 1e-9);
    let weighed = log_evidence(&system, &whitener, &means, &found, &Stream::root(3));
    assert!(weighed.error > 0.0 && weighed.error < 0.1, "{weighed:?}");
    assert!((weighed.value - exact).abs() < 4.0 * weighed.error, "{weighed:?} {exact}");
}

/// With a variance from two replicates the evidence is the integral of prior times multivariate t density (Zellner, An
/// Introduction to Bayesian Inference in Econometrics, section 8.1), here over a grid: of a line that is right, and of one
/// that misses a bend. Laplace's method takes the t density of 24 degrees of freedom in all for a normal one.
#[test]
fn evidence_with_noise_of_few_replicates_is_an_integral_over_a_t_density() {
    let (layouts, parameters) = (layouts(), parameters());
    let estimated = Noise { origins: vec![Origin::Replicates], ..white() };
    for bend in [0.0, 0.02] {
        let truth: Vec<f64> =
            line(1.0, -0.4).iter().enumerate().map(|(t, y)| y + bend * (t * t) as f64).collect();
        let measured = data(7, &truth, 2).into();
        let experiment = Experiment::new(&layouts, &parameters, &LINE, &measured);
        let (_, means) = experiment.means();
        let whitener = Whitener::new(&experiment, &estimated, &means);
        let system = System::new(&experiment, Vec::new());
        let found = fit(&system, &whitener, &means, &[1.0, 0.0]);
        let (freedom, count) = (TIMES as f64, TIMES as f64);
        let density = |a: f64, b: f64| {
            let misfit = |t: usize| 2.0 * ((means[t] - a - b * t as f64) / NOISE).powi(2);
            let square: f64 = (0..TIMES).map(misfit).sum();
            let prior = parameters[0].prior.log_density(a) + parameters[1].prior.log_density(b);
            (prior - 0.5 * (freedom + count) * (1.0 + square / freedom).ln()).exp()
        };
        let (middle, sd) = (&found.at.point, found.sd());
        let steps = -120..=120;
        let at = |k: i32, j: usize| middle[j] + 0.1 * f64::from(k) * sd[j];
        let sum: f64 = steps
            .clone()
            .flat_map(|k| steps.clone().map(move |l| (k, l)))
            .map(|(k, l)| density(at(k, 0), at(l, 1)))
            .sum();
        let exact = (sum * 0.01 * sd[0] * sd[1]).ln();
        let weighed = log_evidence(&system, &whitener, &means, &found, &Stream::root(3));
        assert!((weighed.value - exact).abs() < 4.0 * weighed.error + 0.01, "{weighed:?} {exact}");
        assert!((found.log_evidence() - exact).abs() < 0.3, "{bend} {exact} {found:?}");
    }
}

/// A response that is wrong by an offset of `d` has the gap `d / s`; the true one has none. The mean square of n white
/// numbers has the standard deviation `sqrt(2 / n)`.
#[test]
fn a_gap_that_closes_is_proven() {
    let (layouts, parameters, count) = (layouts(), parameters(), 40);
    let truth = line(1.0, -0.4);
    let held_out = data(8, &truth, count).into();
    let experiment = Experiment::new(&layouts, &parameters, &LINE, &held_out);
    let wrong: Vec<f64> = truth.iter().map(|y| y + NOISE).collect();
    let proof = prove(&experiment, &white(), &[f64::INFINITY], &wrong, &truth).unwrap();
    let bound = 4.0 * (2.0 / (count * TIMES) as f64).sqrt();
    assert!((proof.all.before.powi(2) - 1.0).abs() < 2.0 * bound, "{proof:?}");
    assert!(proof.all.after.powi(2) < bound, "{proof:?}");
    assert!(proof.all.lower < 1.0 && proof.all.upper > 1.0 - bound && proof.shrank, "{proof:?}");
    // 95 % of the values lie in the band; one standard deviation off 83.0 % do: normal table.
    let error = (0.05 * 0.95 / (count * TIMES) as f64).sqrt();
    assert!((proof.coverage[1] - 0.95).abs() < 4.0 * error, "{proof:?}");
    assert!((proof.coverage[0] - 0.830).abs() < 8.0 * error, "{proof:?}");
    // The log of a ratio of normal densities of independent values.
    let ratio = |y: &f64, i: usize| {
        ((y - wrong[i]).powi(2) - (y - truth[i]).powi(2)) / (2.0 * NOISE * NOISE)
    };
    let values = experiment.conditions[0].replicates.iter();
    let each = values.flat_map(|r| r.iter().flatten().enumerate().map(|(i, y)| ratio(y, i)));
    let gained: f64 = each.sum();
    assert!((proof.log_score - gained).abs() < 1e-9 * gained, "{proof:?} {gained}");
    let back = prove(&experiment, &white(), &[f64::INFINITY], &truth, &wrong).unwrap();
    assert!(!back.shrank && back.all.upper < 0.0, "{back:?}");
}

/// Noise-free data are fitted exactly, however many decades a log-uniform prior spans and wherever the search starts.
/// Steps in the unknown itself ended at the lower bound, where the density per unit grows as its reciprocal.
#[test]
fn unknowns_of_many_decades_are_found() {
    let layouts = layouts();
    let mut parameters = parameters();
    for (bounds, truth) in [([1e-6, 1e3], 0.1), ([1e-4, 1e2], 0.5), ([1e-9, 10.0], 0.02)] {
        for p in &mut parameters {
            p.prior = Distribution::LogUniform(bounds);
            p.design = p.prior.clone();
        }
        parameters[0].prior = Distribution::LogUniform([1e-3, 1e4]);
        let curve: Vec<f64> = (0..TIMES).map(|i| 20.0 * (-truth * i as f64).exp()).collect();
        let replicate = |r: usize| Replicate {
            name: r.to_string(),
            values: curve.iter().map(|y| Some(*y)).collect(),
            sd: None,
        };
        let layout = layouts.blocks[0].clone();
        let replicates = (0..REPLICATES).map(replicate).collect();
        let exact = Measurements { layout, replicates, covariance: None };
        let measured = exact.into();
        let experiment = Experiment::new(&layouts, &parameters, &DECAY, &measured);
        let (_, means) = experiment.means();
        let whitener = Whitener::new(&experiment, &white(), &means);
        let system = System::new(&experiment, Vec::new());
        for start in [[1.0, truth * 0.1], [100.0, truth * 3.0], [0.01, truth * 0.01]] {
            let found = fit(&system, &whitener, &means, &start);
            let rate = found.at.point[1] / truth;
            let sd = found.sd()[1] / truth;
            assert!((rate - 1.0).abs() < 0.05 * sd.max(1e-3), "{bounds:?} {start:?}: {found:?}");
        }
    }
}

/// A level alone: `y = a`, whatever `b`.
const LEVEL: MeasuredCurve = MeasuredCurve(|[a, _], _| (a, [1.0, 0.0]));

/// Normal noise about a level, `w` being the sum of the weights of the values. In the logarithm `u` of the level a
/// log-uniform prior is flat and leaves the mean as the mode; a log-normal one shifts it to the root of
/// `w a (m - a) = (ln a - mu) / sigma^2`. By the method of Laplace in `u` the evidence of the log-uniform prior is that
/// of a normal density around the mode: `sqrt(2 pi / w)` over `m` times the length of the logarithm's interval.
#[test]
fn a_level_of_many_decades_has_its_closed_form() {
    let layouts = layouts();
    let mut parameters = parameters();
    let (level, sigma) = (0.4, 1.5);
    let measured = data(9, &[level; TIMES], REPLICATES).into();
    let weight = (REPLICATES * TIMES) as f64 / (NOISE * NOISE);
    let interval: [f64; 2] = [1e-6, 1e3];
    for prior in [Distribution::LogUniform(interval), Distribution::LogNormal([-4.0, sigma])] {
        parameters[0].prior = prior.clone();
        let experiment = Experiment::new(&layouts, &parameters, &LEVEL, &measured);
        let (_, means) = experiment.means();
        let mean = means.iter().sum::<f64>() / TIMES as f64;
        let whitener = Whitener::new(&experiment, &white(), &means);
        let system = System::new(&experiment, Vec::new());
        for start in [1e-6, 1e-3, 1.0, 900.0] {
            let found = fit(&system, &whitener, &means, &[start, 0.5]);
            let a = found.at.point[0];
            if matches!(prior, Distribution::LogUniform(_)) {
                assert!((a - mean).abs() < 1e-6 * mean, "{start}: {a} {mean}");
                let square: f64 = found.residual.iter().map(|z| z * z).sum();
                let alone = 0.5 * (std::f64::consts::TAU / (weight + width(interval, a))).ln()
                    - (a * (interval[1] / interval[0]).ln()).ln();
                let other = parameters[1].prior.log_density(0.5)
                    + (2.0 * std::f64::consts::TAU.sqrt()).ln();
                let exact = alone + other - 0.5 * square;
                assert!((found.log_evidence() - exact).abs() < 1e-6, "{exact} {found:?}");
            } else {
                let slope = weight * a * (mean - a) - (a.ln() + 4.0) / (sigma * sigma);
                assert!(slope.abs() < 1e-3 * weight * a * a, "{start}: {a} {slope}");
            }
        }
    }
}

/// The precision that the width of a log-uniform prior adds at a value.
fn width([low, high]: [f64; 2], a: f64) -> f64 {
    12.0 / (a * (high / low).ln()).powi(2)
}

/// Two unknowns that trade off, in a narrow valley that leaves the box of the priors: the fit ends on the side of the
/// box where the closed form with one unknown at its bound has its root, not where a clamped joint step would.
#[test]
fn a_bound_is_held_while_the_other_unknown_moves_on() {
    let layouts = layouts();
    let mut parameters = parameters();
    parameters[0].prior = Distribution::Uniform([0.0, 1.5]);
    parameters[1].prior = Distribution::Uniform([-1.0, 1.0]);
    // The line 2 - 0.4 t: its level is above the bound.
    let measured = data(7, &line(2.0, -0.4), REPLICATES).into();
    let experiment = Experiment::new(&layouts, &parameters, &LINE, &measured);
    let (_, means) = experiment.means();
    let whitener = Whitener::new(&experiment, &white(), &means);
    let system = System::new(&experiment, Vec::new());
    let sum = |f: &dyn Fn(f64) -> f64| (0..TIMES).map(|t| f(t as f64)).sum::<f64>();
    let slope = sum(&|t| t * (means[t as usize] - 1.5)) / sum(&|t| t * t);
    for start in [[0.1, 0.9], [1.5, -1.0], [0.0, 1.0], [1.4, -0.3]] {
        let found = fit(&system, &whitener, &means, &start);
        let [a, b] = [found.at.point[0], found.at.point[1]];
        assert!((a - 1.5).abs() < 1e-6 && (b - slope).abs() < 1e-6, "{start:?}: {a} {b} {slope}");
    }
}
