//! Calibration with a likelihood that is estimated from runs of a stochastic model: a normal approximation in place of
//! the search for a maximum, and the variance of the estimate.
//!
//! A density whose logarithm has noise has no derivatives, and its maximum is where the noise is largest. The
//! approximation comes from weighted points instead, which move from the prior to the posterior as the likelihood is
//! raised to a power that grows to 1 (population Monte Carlo; Cappé et al., J. Comput. Graph. Stat. 13 (2004) 907). The
//! random numbers are the same at all of its points.

use lacuna::data::Draws;
use lacuna::math::moments;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::forward::Numbers;
use lacuna::plugin::{Fact, Target};
use lacuna::run::Stop;
use lacuna_linalg::{Cholesky, Matrix};
use serde::{Deserialize, Serialize};

use crate::page::number::significant;
use crate::posterior::Posterior;
use crate::stage::sampling::broken;

/// Number of draws of the prior with which the search begins.
const FIRST: usize = 1000;
/// Largest number of rounds of the search.
const ROUNDS: usize = 30;
/// Share of the points of a round that is effective.
const EFFECTIVE: f64 = 0.1;
/// Factor on the standard deviations of the points of the next round: importance weights need tails.
const WIDER: f64 = 1.5;
/// Number of estimates from which the variance of the log-likelihood's estimate is computed: it then has a relative error
/// of `sqrt(2 / 49)`, 20 %.
const ESTIMATES: u64 = 50;

/// Estimate of a likelihood from runs of a stochastic model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LikelihoodEstimate {
    /// Number of runs of the model per estimate.
    pub runs: usize,
    /// Variance of the log-likelihood's estimate at the centre of the posterior, from estimates with different random
    /// numbers; `None` if one of them is zero, so that its logarithm is infinite.
    pub variance: Option<f64>,
    /// True if all these estimates are equal: the response does not depend on the seed.
    pub deterministic: bool,
    /// Longest time for which a chain stayed at one point after the burn-in, as a share of its steps; `None` if the draws
    /// are not the steps of chains.
    pub longest_stay: Option<f64>,
}

impl LikelihoodEstimate {
    /// The estimate as facts for the report.
    pub(super) fn facts(&self) -> Vec<Fact> {
        let variance = self.variance.map_or("infinite".to_owned(), |v| significant(v, 2));
        let mut facts = vec![
            Fact::new("runs of the model per estimate of the likelihood", self.runs),
            Fact::new("variance of the log-likelihood's estimate", variance),
        ];
        if let Some(stay) = self.longest_stay {
            let share = format!("{:.1} % of the steps", 100.0 * stay);
            facts.push(Fact::new("longest stay of a chain at one point", share));
        }
        facts
    }
}

/// Normal distribution of weighted points.
#[derive(Debug, Clone)]
struct Normal {
    mean: Vec<f64>,
    factor: Cholesky,
}

impl Normal {
    /// With mean and covariance of the points.
    fn of(points: &Matrix, weights: &[f64]) -> Result<Self, Stop> {
        let d = points.columns();
        let mut mean = vec![0.0; d];
        for (row, weight) in points.iter_rows().zip(weights).filter(|(_, w)| **w > 0.0) {
            mean.iter_mut().zip(row).for_each(|(m, x)| *m += weight * x);
        }
        let mut covariance = Matrix::zeros(d, d);
        for (row, weight) in points.iter_rows().zip(weights).filter(|(_, w)| **w > 0.0) {
            let gap: Vec<f64> = row.iter().zip(&mean).map(|(x, m)| x - m).collect();
            for i in 0..d {
                for j in 0..d {
                    covariance[(i, j)] += weight * gap[i] * gap[j];
                }
            }
        }
        // Unknowns that are nearly dependent on each other keep a scatter of their own.
        (0..d).for_each(|i| covariance[(i, i)] *= 1.0 + 1e-9);
        let factor = Cholesky::new(&covariance)
            .map_err(|error| Stop::new(format!("the points near the best fit: {error}")))?;
        Ok(Self { mean, factor })
    }

    /// With standard deviations that are larger by a factor.
    fn wider(&self, factor: f64) -> Self {
        let mut lower = self.factor.lower().clone();
        lower.as_mut_slice().iter_mut().for_each(|x| *x *= factor);
        Self { mean: self.mean.clone(), factor: Cholesky::from_lower(lower) }
    }

    fn draws(&self, count: usize, stream: &Stream) -> Matrix {
        let one = |i: usize| {
            let mut rng = stream.at(i as u64).generator();
            let z: Vec<f64> = self.mean.iter().map(|_| normal(&mut rng)).collect();
            let step = self.factor.colour(&z);
            self.mean.iter().zip(step).map(|(m, s)| m + s).collect::<Vec<f64>>()
        };
        Matrix::from_rows(self.mean.len(), (0..count).map(one))
    }

    /// Log density up to a constant.
    fn log_density(&self, point: &[f64]) -> f64 {
        -0.5 * self.factor.quadratic(&self.gap(point))
    }

    fn gap(&self, point: &[f64]) -> Vec<f64> {
        point.iter().zip(&self.mean).map(|(x, m)| x - m).collect()
    }
}

/// An estimated posterior density, with the derivatives of its normal approximation: a sampler without derivatives takes
/// from them the size of its first steps only.
pub(super) struct Estimated<'a> {
    posterior: &'a Posterior<'a>,
    approximation: Normal,
    /// Best point of the search, with its log density.
    best: (Vec<f64>, f64),
    evaluations: usize,
}

impl<'a> Estimated<'a> {
    /// Searches for the bulk of the posterior.
    pub(super) fn search(posterior: &'a Posterior<'a>, stream: &Stream) -> Result<Self, Stop> {
        let common = posterior.with_numbers(Numbers::Common(0));
        let mode = common.mode();
        let count = 100 * (posterior.dimension() + 3);
        let mut points = posterior.prior_draws(FIRST, &stream.named("prior"));
        let mut drawn_from: Option<Normal> = None;
        let (mut power, mut evaluations) = (0.0, 0);
        let mut best = (Vec::new(), f64::NEG_INFINITY);
        let mut round = 0;
        loop {
            let log_prior = Target::log_prior(posterior, &points);
            let density = common.log_density(&points);
            broken(posterior)?;
            evaluations += points.rows();
            for (point, value) in points.iter_rows().zip(&density) {
                if *value > best.1 {
                    best = (point.to_vec(), *value);
                }
            }
            let from = |(i, point): (usize, &[f64])| match &drawn_from {
                None => log_prior[i],
                Some(normal) => normal.log_density(point),
            };
            let from: Vec<f64> = points.iter_rows().enumerate().map(from).collect();
            let weighted = Weighted::new(&log_prior, &density, &from).ok_or_else(|| {
                Stop::new("the estimated likelihood is zero at every point tried in the prior")
                    .help(
                        "check the priors, the units of the measurements and the model's failures",
                    )
            })?;
            let next = weighted.raise(power, EFFECTIVE * points.rows() as f64);
            let approximation = Normal::of(&points, &weighted.at(next))?;
            // One more round at the whole likelihood, from points that were drawn for it.
            let settled = power == 1.0 && next == 1.0;
            (power, round) = (next, round + 1);
            if settled || round == ROUNDS {
                best.1 = mode.log_density(&Matrix::from_rows(best.0.len(), [&best.0]))[0];
                return Ok(Self { posterior, approximation, best, evaluations });
            }
            let wide = approximation.wider(WIDER);
            points = wide.draws(count, &stream.named("round").at(round as u64));
            drawn_from = Some(wide);
        }
    }

    /// Mean of the normal approximation, in place of a maximum; the best point of the search if the density is zero there.
    pub(super) fn maximum(&self) -> Result<lacuna_optimise::Optimum, Stop> {
        let mean = &self.approximation.mean;
        let common = self.posterior.with_numbers(Numbers::Common(0));
        let value = common.mode().log_density(&Matrix::from_rows(mean.len(), [mean]))[0];
        let (point, value) =
            if value.is_finite() { (mean.clone(), value) } else { self.best.clone() };
        self.is_reproducible(&point)?;
        let evaluations = self.evaluations;
        Ok(lacuna_optimise::Optimum {
            point,
            value,
            gradient_norm: 0.0,
            converged: true,
            evaluations,
        })
    }

    /// Refuses a model that returns two responses to the same inputs and seed.
    fn is_reproducible(&self, point: &[f64]) -> Result<(), Stop> {
        let row = Matrix::from_rows(point.len(), [point]);
        let [first, second] = [(); 2].map(|()| self.posterior.log_density(&row)[0].to_bits());
        broken(self.posterior)?;
        if first == second {
            return Ok(());
        }
        let text = "the model gives different responses to the same inputs and the same seed";
        Err(Stop::new(text).help(
            "all its random numbers must come from a generator that is set to the seed at the beginning of each run",
        ))
    }

    /// The estimate at the median of the draws, and the longest stay of a chain.
    pub(super) fn judge(&self, draws: &Draws, chains: bool) -> Result<LikelihoodEstimate, Stop> {
        let median = |j: usize| moments::quantile(&moments::sorted(&draws.pooled(j)), 0.5);
        let centre: Vec<f64> = (0..draws.dimension()).map(median).collect();
        let centre = self.posterior.coordinates(&centre);
        let row = Matrix::from_rows(centre.len(), [&centre]);
        let value = |set| self.posterior.with_numbers(Numbers::Common(set)).log_density(&row)[0];
        let values: Vec<f64> = (1..=ESTIMATES).map(value).collect();
        broken(self.posterior)?;
        let finite = values.iter().all(|value| value.is_finite());
        Ok(LikelihoodEstimate {
            runs: self.posterior.runs().unwrap_or(1),
            variance: finite.then(|| moments::variance(&values)),
            deterministic: values.iter().all(|value| value.to_bits() == values[0].to_bits()),
            longest_stay: chains.then(|| longest_stay(draws)),
        })
    }
}

/// Longest run of equal points of a chain, as a share of its steps.
fn longest_stay(draws: &Draws) -> f64 {
    let mut longest = 0_usize;
    for chain in 0..draws.chains {
        let mut stay = 0_usize;
        for step in 0..draws.steps {
            let same = step > 0 && draws.point(chain, step) == draws.point(chain, step - 1);
            stay = if same { stay + 1 } else { 1 };
            longest = longest.max(stay);
        }
    }
    longest as f64 / draws.steps.max(1) as f64
}

/// Points with the logarithms of their importance weights: that at the power 0 of the likelihood, and the likelihood.
struct Weighted {
    start: Vec<f64>,
    log_likelihood: Vec<f64>,
}

impl Weighted {
    /// From log prior, log density and the log density from which the points were drawn; `None` if all densities are zero.
    fn new(log_prior: &[f64], log_density: &[f64], from: &[f64]) -> Option<Self> {
        let start = log_prior.iter().zip(from).map(|(prior, from)| prior - from).collect();
        let gain = |(density, prior): (&f64, &f64)| {
            if density.is_finite() { density - prior } else { f64::NEG_INFINITY }
        };
        let log_likelihood: Vec<f64> = log_density.iter().zip(log_prior).map(gain).collect();
        let any = log_likelihood.iter().any(|value| value.is_finite());
        any.then_some(Self { start, log_likelihood })
    }

    /// Weights at a power of the likelihood; they sum to 1.
    fn at(&self, power: f64) -> Vec<f64> {
        let both = self.start.iter().zip(&self.log_likelihood);
        let logs: Vec<f64> = both
            .map(|(start, l)| if l.is_finite() { start + power * l } else { f64::NEG_INFINITY })
            .collect();
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let raw: Vec<f64> = logs.iter().map(|l| (l - largest).exp()).collect();
        let sum: f64 = raw.iter().sum();
        raw.iter().map(|weight| weight / sum).collect()
    }

    /// The largest power from `power` to 1 at which so many points are effective; `power` itself if none is.
    fn raise(&self, power: f64, effective: f64) -> f64 {
        let enough = |power: f64| {
            let squares: f64 = self.at(power).iter().map(|weight| weight * weight).sum();
            1.0 / squares >= effective
        };
        if enough(1.0) {
            return 1.0;
        }
        let (mut low, mut high) = (power, 1.0);
        // The first power may be many orders of magnitude below 1.
        for _ in 0..80 {
            let middle =
                if low < 1e-3 * high { (low.max(1e-30) * high).sqrt() } else { 0.5 * (low + high) };
            if enough(middle) { low = middle } else { high = middle }
        }
        low
    }
}

impl Target for Estimated<'_> {
    fn failure(&self) -> Option<String> {
        self.posterior.failure()
    }

    fn dimension(&self) -> usize {
        self.posterior.dimension()
    }

    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        self.posterior.log_density(points)
    }

    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        Target::log_prior(self.posterior, points)
    }

    /// The normal approximation, with its derivatives.
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let mut slope = self.approximation.gap(point);
        self.approximation.factor.solve(&mut slope);
        for s in &mut slope {
            *s = -*s;
        }
        (self.approximation.log_density(point), slope)
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.posterior.bounds()
    }

    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        self.posterior.prior_draws(count, stream)
    }
}
