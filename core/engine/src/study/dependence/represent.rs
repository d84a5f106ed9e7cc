//! Draws as a density: quantiles of each number, and a mixture of normal distributions of their normal scores.

use lacuna::diagnose::divergence::{Divergence, divergence};
use lacuna::diagnose::energy::{Energy, energy};
use lacuna::math::dependence::{Copula, Mixture};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;

/// Draws of several numbers with what is known of them.
pub(super) struct Sample {
    /// Draws by chain.
    pub(super) chains: Vec<Vec<Vec<f64>>>,
    /// Support of each number.
    pub(super) supports: Vec<(f64, f64)>,
    /// Number of independent draws that the draws are worth.
    pub(super) effective: f64,
}

/// A density that represents draws.
pub(super) struct Density {
    /// Distribution of each number.
    pub(super) marginals: Vec<Distribution>,
    /// Their dependence; `None` for one number.
    pub(super) copula: Option<Mixture>,
    /// Comparison with draws that the density was not fitted to.
    pub(super) check: Check,
}

/// Comparison of a density with draws that it was not fitted to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// Energy distance of draws of the density from the held-out draws.
    pub energy: Energy,
    /// Divergence of the density from that of the held-out draws.
    pub divergence: Divergence,
}

/// Divergence, in nats, that a good representation does not exceed by more than its estimate's error: it shifts a mean by
/// about 0.4 standard deviations at most.
const DIVERGENCE: f64 = 0.1;
/// Probability of the energy distance below which the two samples differ.
const PROBABILITY: f64 = 0.01;

impl Check {
    const NONE: Self = Self {
        energy: Energy { coefficient: f64::NAN, probability: f64::NAN },
        divergence: Divergence { value: f64::NAN, error: f64::NAN },
    };

    /// True if the held-out draws contradict the density, or are too few to show their shape: a divergence is not negative,
    /// but its estimate is if the draws lie on something thinner than their distances.
    pub fn is_poor(&self) -> bool {
        let Divergence { value, error } = self.divergence;
        value.abs() - 3.0 * error > DIVERGENCE || self.energy.probability <= PROBABILITY
    }
}

/// Shares of each chain that are fitted and that choose the number of components; the rest is compared.
const FITTED: f64 = 0.6;
const CHOSEN: f64 = 0.8;
/// Largest number of draws that a mixture is fitted to, and that are compared.
const DRAWS: usize = 4000;
const COMPARED: usize = 400;
const DIVERGED: usize = 1500;

impl Density {
    /// The density of a sample; `None` if its draws are too few or too often equal.
    pub(super) fn of(sample: &Sample) -> Option<Self> {
        let parts = |from: f64, to: f64| -> Vec<Vec<f64>> {
            let part = |chain: &Vec<Vec<f64>>| {
                let at = |share: f64| (share * chain.len() as f64) as usize;
                chain[at(from)..at(to)].to_vec()
            };
            sample.chains.iter().flat_map(part).collect()
        };
        let (first, second, third) =
            (parts(0.0, FITTED), parts(FITTED, CHOSEN), parts(CHOSEN, 1.0));
        let tried = fitted(sample, &first, &second, FITTED * sample.effective)?;
        let independent = ((1.0 - CHOSEN) * sample.effective) as usize;
        let held_out = thinned(&third, COMPARED.min(independent.max(20)));
        let check = Check {
            energy: tried.compared(&held_out),
            divergence: tried.divergence(&thinned(&third, DIVERGED.min(independent.max(50)))),
        };
        let rest = [first, third].concat();
        let whole = fitted(sample, &rest, &second, sample.effective)?;
        Some(Self { check, ..whole })
    }

    fn divergence(&self, held_out: &[Vec<f64>]) -> Divergence {
        let score = |point: &Vec<f64>| -> Vec<f64> {
            self.marginals.iter().zip(point).map(|(law, &x)| law.score(x)).collect()
        };
        let scores: Vec<Vec<f64>> = held_out.iter().map(score).collect();
        let standard = Distribution::Normal([0.0, 1.0]);
        let log_density = |z: &Vec<f64>| match &self.copula {
            Some(mixture) => mixture.log_density(z),
            None => standard.log_density(z[0]),
        };
        divergence(&scores, &scores.iter().map(log_density).collect::<Vec<_>>())
    }

    /// The energy distance of as many draws of the density from these, each number in units of its spread.
    fn compared(&self, held_out: &[Vec<f64>]) -> Energy {
        let stream = Stream::root(0).named("posterior as prior");
        let mut rng = stream.named("draws").generator();
        let laws: Vec<&Distribution> = self.marginals.iter().collect();
        let draw = |_: &Vec<f64>| match &self.copula {
            Some(mixture) => Copula::Mixture(mixture.clone()).sample(&laws, &mut rng),
            None => vec![laws[0].sample(&mut rng)],
        };
        let drawn: Vec<Vec<f64>> = held_out.iter().map(draw).collect();
        let spread: Vec<f64> =
            laws.iter().map(|law| 0.25 * (law.quantile(0.975) - law.quantile(0.025))).collect();
        let scaled = |points: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let one = |point: &Vec<f64>| point.iter().zip(&spread).map(|(x, s)| x / s).collect();
            points.iter().map(one).collect()
        };
        energy(&scaled(held_out), &scaled(&drawn), &stream.named("permutations"))
    }
}

fn fitted(
    sample: &Sample,
    draws: &[Vec<f64>],
    others: &[Vec<f64>],
    effective: f64,
) -> Option<Density> {
    let marginal = |(j, &support): (usize, &(f64, f64))| {
        let values: Vec<f64> = draws.iter().map(|point| point[j]).collect();
        Distribution::of_draws(&values, support, effective)
    };
    let marginals: Vec<Distribution> =
        sample.supports.iter().enumerate().map(marginal).collect::<Option<_>>()?;
    let scores = |points: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let one = |point: &Vec<f64>| {
            marginals.iter().zip(point).map(|(law, &x)| law.score(x).clamp(-6.0, 6.0)).collect()
        };
        thinned(points, DRAWS).iter().map(one).collect()
    };
    let copula = if marginals.len() > 1 {
        let stream = Stream::root(0).named("posterior as prior").named("mixture");
        Some(Mixture::fit(&scores(draws), &scores(others), &stream)?)
    } else {
        None
    };
    Some(Density { marginals, copula, check: Check::NONE })
}

/// At most `count` draws at equal distances.
fn thinned(draws: &[Vec<f64>], count: usize) -> Vec<Vec<f64>> {
    let kept = count.min(draws.len());
    (0..kept).map(|i| draws[i * draws.len() / kept].clone()).collect()
}

#[cfg(test)]
mod tests;
