//! Problems with known evidence, and a complete run of a sampler on one of them.

use lacuna::math::distribution::Distribution;
use lacuna::math::moments::{Moments, mean, variance};
use lacuna::math::random::{Stream, normal};
use lacuna::math::special::HALF_LN_TWO_PI;
use lacuna::plugin::sampler::Harvest;
use lacuna::plugin::{Sampler, Target};
use lacuna_linalg::{Cholesky, Matrix, multiply_transposed};
use rayon::prelude::*;

type Likelihood = Box<dyn Fn(&[f64]) -> f64 + Sync>;

/// A target with independent priors and a given likelihood.
pub(super) struct Known {
    priors: Vec<Distribution>,
    /// Number of trailing coordinates that are the logarithm of the quantity with the prior.
    logs: usize,
    log_likelihood: Likelihood,
    /// Logarithm of the evidence.
    pub log_evidence: f64,
}

impl Target for Known {
    fn dimension(&self) -> usize {
        self.priors.len()
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        let prior = self.log_prior(points);
        let at = |(point, prior): (&[f64], f64)| {
            if prior.is_finite() { prior + (self.log_likelihood)(point) } else { prior }
        };
        points.iter_rows().zip(prior).map(at).collect()
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let of = |(j, (prior, &x)): (usize, (&Distribution, &f64))| {
            if self.is_log(j) { prior.log_density(x.exp()) + x } else { prior.log_density(x) }
        };
        let at = |point: &[f64]| self.priors.iter().zip(point).enumerate().map(of).sum();
        points.iter_rows().map(at).collect()
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        (f64::NAN, vec![f64::NAN; point.len()])
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        let of = |(j, prior): (usize, &Distribution)| match prior.support() {
            (low, high) if self.is_log(j) => (low.ln(), high.ln()),
            support => support,
        };
        self.priors.iter().enumerate().map(of).collect()
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, self.priors.len(), |_, j| {
            let drawn = self.priors[j].sample(&mut rng);
            if self.is_log(j) { drawn.ln() } else { drawn }
        })
    }
}

impl Known {
    fn is_log(&self, coordinate: usize) -> bool {
        coordinate + self.logs >= self.priors.len()
    }
}

/// Mean of two data with a normal prior, as in the self-test of UQLab: prior N(7, variance 2), data 9.1241 and 8.151
/// with variance 3; the posterior is N(7.935743, variance 0.857143).
pub(super) fn two_data() -> Known {
    let log_likelihood = |x: &[f64]| {
        let misfit = (9.1241 - x[0]).powi(2) + (8.151 - x[0]).powi(2);
        -misfit / 6.0 - 3.0_f64.ln() - 2.0 * HALF_LN_TWO_PI
    };
    // Marginally the data are normal with mean 7, variance 5 and covariance 2.
    let (a, b) = (9.1241 - 7.0, 8.151 - 7.0);
    let quadratic = (5.0 * (a * a + b * b) - 4.0 * a * b) / 21.0;
    Known {
        priors: vec![Distribution::Normal([7.0, 2.0_f64.sqrt()])],
        logs: 0,
        log_likelihood: Box::new(log_likelihood),
        log_evidence: -0.5 * (quadratic + 21.0_f64.ln()) - 2.0 * HALF_LN_TWO_PI,
    }
}

/// Linear regression of 40 data on 5 functions with normal priors and known noise: marginally the data are normal
/// with covariance `s^2 I + t^2 X X'`.
pub(super) fn regression() -> Known {
    let (n, d, noise, width) = (40, 5, 0.3, 2.0);
    let mut rng = Stream::root(11).named("regression").generator();
    let x = Matrix::from_fn(n, d, |i, j| (i as f64 / n as f64).powi(j as i32));
    let truth: Vec<f64> = (0..d).map(|_| normal(&mut rng)).collect();
    let mean = |row: &[f64], b: &[f64]| row.iter().zip(b).map(|(x, b)| x * b).sum::<f64>();
    let y: Vec<f64> =
        x.iter_rows().map(|row| mean(row, &truth) + noise * normal(&mut rng)).collect();
    let mut covariance = multiply_transposed(&x, &x);
    covariance.as_mut_slice().iter_mut().for_each(|c| *c *= width * width);
    (0..n).for_each(|i| covariance[(i, i)] += noise * noise);
    let factor = Cholesky::new(&covariance).unwrap();
    let log_evidence =
        -0.5 * (factor.quadratic(&y) + factor.log_determinant()) - n as f64 * HALF_LN_TWO_PI;
    let log_likelihood = move |b: &[f64]| {
        let misfit: f64 = x.iter_rows().zip(&y).map(|(row, y)| (y - mean(row, b)).powi(2)).sum();
        -0.5 * misfit / (noise * noise) - n as f64 * (noise.ln() + HALF_LN_TWO_PI)
    };
    let priors = vec![Distribution::Normal([0.0, width]); d];
    Known { priors, logs: 0, log_likelihood: Box::new(log_likelihood), log_evidence }
}

/// A posterior as informative as the founding study's: linear regression of 21,000 data on `unknowns` coefficients
/// with wide uniform priors, and the logarithm of the variance, which has a half-normal prior.
///
/// With the prior volume `V` of the coefficients and their least-squares misfit `R` the evidence is
/// `1/V int p(v) (2 pi v)^(-(n - d)/2) exp(-R / 2v) dv / sqrt(det X'X)`, as long as the posterior is negligible at the
/// bounds; the integral over the variance is a sum over its logarithm.
pub(super) fn informative(unknowns: usize) -> Known {
    let (n, noise, wide) = (21_000.0_f64, 32.0_f64, 1000.0);
    let variance_prior = Distribution::HalfNormal(1e6);
    // X'X / n, with a correlation of 0.8 between neighbours.
    let gram = Matrix::from_fn(unknowns, unknowns, |i, j| n * 0.8_f64.powi(i.abs_diff(j) as i32));
    let factor = Cholesky::new(&gram).unwrap();
    let misfit = (n - unknowns as f64) * noise * noise;
    let best: Vec<f64> = (0..unknowns).map(|j| 300.0 * (1.7 * j as f64).sin()).collect();
    let log_likelihood = move |x: &[f64]| {
        let offset: Vec<f64> = x.iter().zip(&best).map(|(x, b)| x - b).collect();
        let product = |row: &[f64]| row.iter().zip(&offset).map(|(g, o)| g * o).sum::<f64>();
        let square: f64 = gram.iter_rows().zip(&offset).map(|(row, o)| o * product(row)).sum();
        let log_variance = x[unknowns];
        -0.5 * (misfit + square) / log_variance.exp() - n * (0.5 * log_variance + HALF_LN_TWO_PI)
    };
    let free = n - unknowns as f64;
    let log_integrand = |t: f64| {
        variance_prior.log_density(t.exp()) + t
            - free * (0.5 * t + HALF_LN_TWO_PI)
            - 0.5 * misfit / t.exp()
    };
    let (middle, sd, steps) = ((noise * noise).ln(), (2.0 / free).sqrt(), 2000);
    let width = 20.0 * sd / f64::from(steps);
    let values = (0..=steps).map(|k| log_integrand(middle - 10.0 * sd + width * f64::from(k)));
    let values: Vec<f64> = values.collect();
    let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let integral = top + (values.iter().map(|v| (v - top).exp()).sum::<f64>() * width).ln();
    let mut priors = vec![Distribution::Uniform([-wide, wide]); unknowns];
    priors.push(Distribution::HalfNormal(1e6));
    Known {
        priors,
        logs: 1,
        log_likelihood: Box::new(log_likelihood),
        log_evidence: integral
            - unknowns as f64 * (2.0 * wide).ln()
            - 0.5 * factor.log_determinant(),
    }
}

/// Two thin spherical shells in a box: Feroz and Hobson, MNRAS 384 (2008) 449, section 5.2 and table 1, with radius 2,
/// width 0.1, centres at 3.5 and -3.5 on the first axis, prior uniform on (-6, 6). Their values of the log evidence are
/// -1.75, -5.67 and -14.59 in 2, 5 and 10 dimensions.
pub(super) fn shells(dimension: usize) -> Known {
    let log_likelihood = |x: &[f64]| {
        let shell = |centre: f64| {
            let rest: f64 = x[1..].iter().map(|x| x * x).sum();
            let radius = ((x[0] - centre).powi(2) + rest).sqrt();
            -0.5 * ((radius - 2.0) / 0.1).powi(2) - 0.1_f64.ln() - HALF_LN_TWO_PI
        };
        let (a, b) = (shell(-3.5), shell(3.5));
        a.max(b) + (-(a - b).abs()).exp().ln_1p()
    };
    let log_evidence = match dimension {
        2 => -1.75,
        5 => -5.67,
        10 => -14.59,
        _ => panic!("no published value for {dimension} dimensions"),
    };
    let priors = vec![Distribution::Uniform([-6.0, 6.0]); dimension];
    Known { priors, logs: 0, log_likelihood: Box::new(log_likelihood), log_evidence }
}

/// A normal likelihood well inside a uniform prior on the unit cube, with a correlation of 0.8 between neighbours:
/// the evidence is its integral, 1, and the information gain of the posterior is `information` nats.
pub(super) fn peak(dimension: usize, information: f64) -> Known {
    // The entropy of a normal distribution with covariance s^2 R is d (ln s + 1/2 ln 2 pi e) + 1/2 ln det R.
    let correlation =
        Matrix::from_fn(dimension, dimension, |i, j| 0.8_f64.powi((i as i32 - j as i32).abs()));
    let factor = Cholesky::new(&correlation).unwrap();
    let half = 0.5 * factor.log_determinant();
    let d = dimension as f64;
    let ln_sd = -(information + half) / d - HALF_LN_TWO_PI - 0.5;
    let log_likelihood = move |x: &[f64]| {
        let z: Vec<f64> = x.iter().map(|x| (x - 0.4) / ln_sd.exp()).collect();
        -0.5 * factor.quadratic(&z) - d * (ln_sd + HALF_LN_TWO_PI) - half
    };
    let priors = vec![Distribution::Uniform([0.0, 1.0]); dimension];
    Known { priors, logs: 0, log_likelihood: Box::new(log_likelihood), log_evidence: 0.0 }
}

/// Two normal peaks on the unit square, one with three quarters of the mass, about thirty widths apart.
fn two_peaks() -> Known {
    let log_likelihood = |x: &[f64]| {
        let peak = |share: f64, centre: f64, sd: f64| {
            let square: f64 = x.iter().map(|x| ((x - centre) / sd).powi(2)).sum();
            share.ln() - 0.5 * square - 2.0 * (sd.ln() + HALF_LN_TWO_PI)
        };
        let (a, b) = (peak(0.75, 0.25, 0.01), peak(0.25, 0.7, 0.02));
        a.max(b) + (-(a - b).abs()).exp().ln_1p()
    };
    let priors = vec![Distribution::Uniform([0.0, 1.0]); 2];
    Known { priors, logs: 0, log_likelihood: Box::new(log_likelihood), log_evidence: 0.0 }
}

/// A given likelihood with a uniform prior on the unit cube.
pub(super) fn unit_cube(
    dimension: usize,
    log_evidence: f64,
    log_likelihood: impl Fn(&[f64]) -> f64 + Sync + 'static,
) -> Known {
    let priors = vec![Distribution::Uniform([0.0, 1.0]); dimension];
    Known { priors, logs: 0, log_likelihood: Box::new(log_likelihood), log_evidence }
}

/// Runs a sampler to its end; returns its harvest and the number of evaluations of the density.
pub(super) fn run(sampler: &dyn Sampler, target: &dyn Target, seed: u64) -> (Harvest, u64) {
    let root = Stream::root(seed);
    let plan = sampler.plan(target.dimension());
    // The starting points must have a likelihood above zero, and some priors reach far beyond its support.
    let drawn = target.prior_draws(200 * plan.chains, &root.named("start"));
    let inside = target.log_density(&drawn).into_iter().map(f64::is_finite);
    let inside = inside.enumerate().filter(|(_, is)| *is).map(|(i, _)| i);
    let points = drawn.select_rows(&inside.take(plan.chains).collect::<Vec<_>>());
    let mut state = sampler.start(target, points).unwrap();
    for step in 0..plan.steps {
        if sampler.finished(&state) {
            break;
        }
        sampler.step(target, &mut state, &root.named("step").at(step as u64)).unwrap();
    }
    let harvest = sampler.harvest(target, &state, &root.named("harvest")).unwrap();
    (harvest.unwrap(), state.evaluations)
}

/// Returns the log evidence of a run and its standard error.
pub(super) fn evidence(harvest: &Harvest) -> (f64, f64) {
    let evidence = harvest.evidence.as_ref().unwrap();
    (evidence.log, evidence.error)
}

/// Asserts that the log evidence is within 0.1 of the truth, and within four standard errors.
pub(super) fn assert_evidence(
    what: &str,
    sampler: &dyn Sampler,
    target: &Known,
    seed: u64,
) -> Harvest {
    let (harvest, _) = run(sampler, target, seed);
    let (log, error) = evidence(&harvest);
    let off = log - target.log_evidence;
    assert!(off.abs() < 0.1, "{what}: off by {off} +- {error}");
    // Published values have two decimals, hence the allowance of 0.005.
    assert!(off.abs() < 4.0 * error + 0.005, "{what}: off by {off} +- {error}");
    harvest
}

/// Kullback-Leibler divergence of a normal distribution with the moments of the draws from the posterior of
/// [`two_data`].
fn divergence(harvest: &Harvest) -> f64 {
    let moments = Moments::of_rows(&harvest.points);
    let ratio = moments.covariance()[(0, 0)] / 0.857_143;
    let mean = moments.mean()[0] - 7.935_743;
    0.5 * (ratio - 1.0 - ratio.ln() + mean * mean / 0.857_143)
}

/// Log evidences of runs with different seeds, compared with the truth.
#[derive(Debug)]
pub(super) struct Calibration {
    /// Number of runs.
    pub runs: usize,
    /// Mean error of the log evidence.
    pub bias: f64,
    /// Mean and standard deviation of the errors divided by their stated standard errors.
    pub standardised: (f64, f64),
    /// Mean stated standard error.
    pub error: f64,
    /// Mean number of evaluations.
    pub evaluations: f64,
}

/// Number of runs of a calibration: half of a night's at each change. `LACUNA_TRUTH=1` runs all.
pub(super) fn runs(of_a_night: usize) -> usize {
    if std::env::var_os("LACUNA_TRUTH").is_some() { of_a_night } else { of_a_night / 2 }
}

pub(super) fn calibration(sampler: &dyn Sampler, target: &Known, runs: usize) -> Calibration {
    let found: Vec<(f64, f64, f64)> = (0..runs as u64)
        .into_par_iter()
        .map(|seed| {
            let (harvest, evaluations) = run(sampler, target, seed);
            let (log, error) = evidence(&harvest);
            (log - target.log_evidence, error, evaluations as f64)
        })
        .collect();
    let standardised: Vec<f64> = found.iter().map(|(off, error, _)| off / error).collect();
    let mean_of = |f: fn(&(f64, f64, f64)) -> f64| mean(&found.iter().map(f).collect::<Vec<_>>());
    Calibration {
        runs,
        bias: mean_of(|x| x.0),
        standardised: (mean(&standardised), variance(&standardised).sqrt()),
        error: mean_of(|x| x.1),
        evaluations: mean_of(|x| x.2),
    }
}

impl Calibration {
    /// Asserts that the stated standard errors hold. The mean of the standardised errors has the standard deviation
    /// `1 / sqrt(runs)`, of which four are allowed; their variance is chi-square distributed, with the standard
    /// deviation `sqrt(2 / (runs - 1))`. Three of these, and an uncertainty of a fifth of the stated errors
    /// themselves, give the bounds.
    pub fn assert(&self, what: &str) {
        let runs = self.runs as f64;
        let three = 3.0 * (2.0 / (runs - 1.0)).sqrt();
        let (low, high) = ((1.0 - three).max(0.0).sqrt() / 1.2, (1.0 + three).sqrt() * 1.2);
        let (mean, sd) = self.standardised;
        assert!((low..high).contains(&sd), "{what}: {self:?}, not in {low} to {high}");
        assert!(mean.abs() < 4.0 / runs.sqrt(), "{what}: {self:?}");
    }

    /// Like [`Calibration::assert`]; the mean must also be within 0.1 of the truth.
    pub fn assert_close(&self, what: &str) {
        self.assert(what);
        assert!(self.bias.abs() < 0.1, "{what}: {self:?}");
    }
}

/// Asserts that the median divergence of the draws of twenty runs from a conjugate posterior is below 0.01.
pub(super) fn assert_conjugate(sampler: &dyn Sampler) {
    let target = two_data();
    let mut divergences: Vec<f64> =
        (0..20).map(|seed| divergence(&run(sampler, &target, seed).0)).collect();
    divergences.sort_by(f64::total_cmp);
    assert!(divergences[10] < 0.01, "{divergences:?}");
}

/// Asserts that two separated peaks have the right mass in the mean of twenty runs; `largest` bounds its standard
/// error.
pub(super) fn assert_shares(sampler: &dyn Sampler, largest: f64) {
    let target = two_peaks();
    let share = |seed| {
        let (harvest, _) = run(sampler, &target, seed);
        let large = harvest.points.iter_rows().filter(|x| x[0] < 0.45).count();
        large as f64 / harvest.points.rows() as f64
    };
    let shares: Vec<f64> = (0..20).map(share).collect();
    let error = (variance(&shares) / 20.0).sqrt();
    assert!((mean(&shares) - 0.75).abs() < 4.0 * error, "{} +- {error}", mean(&shares));
    assert!(error < largest, "{error}");
}

/// Asserts that over many runs the mean of the draws scatters by the posterior's standard deviation over the root of
/// the stated effective size.
pub(super) fn assert_effective_size(sampler: &dyn Sampler) {
    let target = two_data();
    let runs: Vec<_> = (0..60).map(|seed| run(sampler, &target, seed).0).collect();
    let means: Vec<f64> = runs.iter().map(|h| mean(&h.points.column(0))).collect();
    let sizes: Vec<f64> = runs.iter().map(|h| h.effective_size).collect();
    let real = 0.857_143 / variance(&means);
    let stated = mean(&sizes);
    // The variance of 60 means is known to sqrt(2 / 59) = 18 %.
    assert!((stated / real - 1.0).abs() < 0.6, "stated {stated}, real {real}");
}

/// Asserts the evidence of a likelihood that is zero on most of the prior.
pub(super) fn assert_support(sampler: &dyn Sampler) {
    let function = |x: &[f64]| if x[0] < 0.02 { 0.0 } else { f64::NEG_INFINITY };
    calibration(sampler, &unit_cube(2, 0.02_f64.ln(), function), 20).assert("support");
}
