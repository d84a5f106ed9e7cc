//! Walkers at all temperatures, and their moves.

use lacuna::math::random::{Stream, below, normal, permutation, uniform};
use lacuna::plugin::Target;
use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

use crate::samplers::evaluated::Evaluated;

/// Scale of a stretch (Goodman and Weare 2010).
const STRETCH: f64 = 2.0;
/// Probability of a jump by the full difference, which can lead from one maximum to another.
const LEAPS: f64 = 0.1;
/// Relative standard deviation of the lengths of the other jumps.
const JITTER: f64 = 0.1;

/// Walkers of several temperatures, one temperature after the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Levels {
    walkers: usize,
    /// Coordinates of the walkers, one walker after the other.
    points: Vec<f64>,
    /// Log prior density of each walker.
    pub log_prior: Vec<f64>,
    /// Log density of each walker, prior times likelihood; the smallest number where it is zero, because files have no
    /// infinity.
    pub log_density: Vec<f64>,
}

impl Levels {
    /// Walkers of one temperature.
    pub fn new(points: &Matrix, log_density: &[f64], log_prior: &[f64]) -> Self {
        Self {
            walkers: points.rows(),
            points: points.as_slice().to_vec(),
            log_prior: log_prior.to_vec(),
            log_density: log_density.iter().map(|density| finite(*density)).collect(),
        }
    }

    /// The same walkers at `count` temperatures.
    pub fn repeated(&self, count: usize) -> Self {
        Self {
            walkers: self.walkers,
            points: self.points.repeat(count),
            log_prior: self.log_prior.repeat(count),
            log_density: self.log_density.repeat(count),
        }
    }

    /// Adds the temperatures of others after these.
    pub fn append(&mut self, others: &Self) {
        self.points.extend(&others.points);
        self.log_prior.extend(&others.log_prior);
        self.log_density.extend(&others.log_density);
    }

    /// Takes the walkers of the first temperature out.
    pub fn take_first(&mut self) -> Self {
        let d = self.dimension();
        let rest = self.points.split_off(self.walkers * d);
        let prior = self.log_prior.split_off(self.walkers);
        let density = self.log_density.split_off(self.walkers);
        Self {
            walkers: self.walkers,
            points: std::mem::replace(&mut self.points, rest),
            log_prior: std::mem::replace(&mut self.log_prior, prior),
            log_density: std::mem::replace(&mut self.log_density, density),
        }
    }

    /// The points, one per row.
    pub fn matrix(&self) -> Matrix {
        Matrix::from_vec(self.log_prior.len(), self.dimension(), self.points.clone())
    }

    /// Log-likelihoods of the walkers of one temperature.
    pub fn of_level(&self, level: usize) -> Vec<f64> {
        let walkers = level * self.walkers..(level + 1) * self.walkers;
        walkers.map(|walker| self.log_likelihood(walker)).collect()
    }

    fn log_likelihood(&self, walker: usize) -> f64 {
        let density = self.log_density[walker];
        if density > f64::MIN { density - self.log_prior[walker] } else { f64::MIN }
    }

    fn dimension(&self) -> usize {
        self.points.len() / self.log_prior.len()
    }

    fn point(&self, walker: usize) -> &[f64] {
        let d = self.dimension();
        &self.points[walker * d..(walker + 1) * d]
    }

    fn put(&mut self, walker: usize, from: &Evaluated, row: usize) {
        let d = self.dimension();
        self.points[walker * d..(walker + 1) * d].copy_from_slice(from.points.row(row));
        self.log_prior[walker] = from.log_prior[row];
        self.log_density[walker] = finite(from.log_density[row]);
    }

    /// Moves all walkers once; returns the number of evaluations. The temperatures are evaluated together.
    pub fn step(&mut self, target: &dyn Target, powers: &[f64], stream: &Stream) -> u64 {
        let last = powers.len() - 1;
        let mut evaluations = 0;
        let half = self.walkers / 2;
        for (turn, from) in [0, half].into_iter().enumerate() {
            let mut rng = stream.at(turn as u64).generator();
            let mut proposals = Matrix::zeros(0, self.dimension());
            let mut factors = Vec::new();
            let mut decisions = Vec::new();
            for level in 0..last {
                let first = level * self.walkers;
                let others = first + (half - from);
                for i in 0..half {
                    let (point, factor) = self.proposal(first + from + i, others, half, &mut rng);
                    proposals.push_row(&point);
                    factors.push(factor);
                    decisions.push(uniform(&mut rng).ln());
                }
            }
            let tried = Evaluated::new(target, proposals);
            evaluations += tried.evaluations;
            for (row, decision) in decisions.into_iter().enumerate() {
                let (level, i) = (row / half, row % half);
                let walker = level * self.walkers + from + i;
                let likelihood = tried.log_likelihood(row);
                let gain = powers[level] * (likelihood - self.log_likelihood(walker));
                let ratio = factors[row] + tried.log_prior[row] - self.log_prior[walker] + gain;
                if likelihood.is_finite() && decision < ratio {
                    self.put(walker, &tried, row);
                }
            }
        }
        let drawn =
            Evaluated::new(target, target.prior_draws(self.walkers, &stream.named("prior")));
        evaluations += drawn.evaluations;
        (0..self.walkers).for_each(|i| self.put(last * self.walkers + i, &drawn, i));
        evaluations
    }

    /// A proposal for a walker, given those from `others` on, with the logarithm of its factor of acceptance.
    fn proposal(
        &self,
        walker: usize,
        others: usize,
        half: usize,
        rng: &mut impl rand::Rng,
    ) -> (Vec<f64>, f64) {
        let (here, d) = (self.point(walker), self.dimension() as f64);
        let k = below(rng, half);
        let one = self.point(others + k);
        if uniform(rng) < 0.5 {
            // The density of the factor is proportional to 1 / sqrt(z) between 1 / a and a.
            let z = ((STRETCH - 1.0) * uniform(rng) + 1.0).powi(2) / STRETCH;
            let point = one.iter().zip(here).map(|(o, x)| o + z * (x - o)).collect();
            return (point, (d - 1.0) * z.ln());
        }
        let other = self.point(others + (k + 1 + below(rng, half - 1)) % half);
        let length = if uniform(rng) < LEAPS {
            1.0
        } else {
            2.38 / (2.0 * d).sqrt() * (1.0 + JITTER * normal(rng))
        };
        let jump = one.iter().zip(other).map(|(a, b)| length * (a - b));
        (here.iter().zip(jump).map(|(x, j)| x + j).collect(), 0.0)
    }

    /// Exchanges points between neighbouring temperatures, the hottest first; returns the fraction of pairs that were
    /// exchanged.
    pub fn exchange(&mut self, powers: &[f64], stream: &Stream) -> Vec<f64> {
        let mut shares = vec![0.0; powers.len() - 1];
        for hot in (1..powers.len()).rev() {
            let mut rng = stream.at(hot as u64).generator();
            let partners = permutation(&mut rng, self.walkers);
            let mut count = 0;
            for (i, partner) in partners.into_iter().enumerate() {
                let (a, b) = ((hot - 1) * self.walkers + i, hot * self.walkers + partner);
                let gain = self.log_likelihood(b) - self.log_likelihood(a);
                if uniform(&mut rng).ln() < (powers[hot - 1] - powers[hot]) * gain {
                    self.swap(a, b);
                    count += 1;
                }
            }
            shares[hot - 1] = f64::from(count) / self.walkers as f64;
        }
        shares
    }

    fn swap(&mut self, a: usize, b: usize) {
        let d = self.dimension();
        (0..d).for_each(|k| self.points.swap(a * d + k, b * d + k));
        self.log_prior.swap(a, b);
        self.log_density.swap(a, b);
    }
}

/// The number itself; the smallest one for minus infinity and what is not a number.
fn finite(x: f64) -> f64 {
    if x.is_finite() { x } else { f64::MIN }
}
