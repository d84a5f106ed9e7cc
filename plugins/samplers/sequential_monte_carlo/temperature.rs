//! One change of temperature: weights, evidence, and the particles drawn anew.

use lacuna::math::random::{Stream, uniform};
use lacuna::run::Stop;
use rand::Rng;

use super::{Evaluated, Memory, SequentialMonteCarlo, Shape};

/// Weights of particles.
pub(super) struct Weights {
    /// They sum to one.
    pub normalised: Vec<f64>,
    /// The log of the mean of the weights before that.
    pub log_mean: f64,
    /// Their effective number, `(sum w)^2 / sum w^2`.
    pub effective: f64,
}

impl Weights {
    /// The weights `likelihood^power`.
    pub fn new(log_likelihood: &[f64], power: f64) -> Self {
        let largest = log_likelihood.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let raw: Vec<f64> = log_likelihood.iter().map(|l| (power * (l - largest)).exp()).collect();
        let sum: f64 = raw.iter().sum();
        let squares: f64 = raw.iter().map(|w| w * w).sum();
        Self {
            log_mean: power * largest + (sum / raw.len() as f64).ln(),
            effective: sum * sum / squares,
            normalised: raw.iter().map(|w| w / sum).collect(),
        }
    }
}

/// The largest increase of the power, at most `rest`, that leaves this many particles effective.
pub(super) fn increase(log_likelihood: &[f64], effective: f64, rest: f64) -> f64 {
    let enough = |power: f64| Weights::new(log_likelihood, power).effective >= effective;
    if enough(rest) {
        return rest;
    }
    // The effective number falls from all to few over many orders of magnitude: halve the logarithm.
    let (mut low, mut high) = (rest.ln() - 80.0, rest.ln());
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if enough(middle.exp()) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low.exp()
}

/// Places drawn independently in proportion to weights, in ascending order.
///
/// Systematic draws would vary less, but the family tree that they make does not tell the error of the
/// evidence.
pub(super) fn draw(weights: &[f64], rng: &mut impl Rng) -> Vec<usize> {
    let mut levels: Vec<f64> = weights.iter().map(|_| uniform(rng)).collect();
    levels.sort_by(f64::total_cmp);
    let (mut place, mut sum) = (0, weights[0]);
    let mut places = Vec::with_capacity(levels.len());
    for level in levels {
        while level > sum && place + 1 < weights.len() {
            place += 1;
            sum += weights[place];
        }
        places.push(place);
    }
    places
}

impl SequentialMonteCarlo {
    /// Raises the temperature's power as far as the weights allow and draws the particles anew;
    /// the shape of the weighted particles.
    pub(super) fn cool(
        &self,
        population: &mut Evaluated,
        memory: &mut Memory,
        stream: &Stream,
    ) -> Result<Shape, Stop> {
        let log_likelihood = population.log_likelihoods();
        let (count, rest) = (self.particles as f64, 1.0 - memory.temperature);
        let power = increase(&log_likelihood, self.effective_share * count, rest);
        // The sum of two roundings must not miss the end.
        memory.temperature = if power == rest { 1.0 } else { memory.temperature + power };
        let weights = Weights::new(&log_likelihood, power);
        memory.log_evidence += weights.log_mean;
        memory.independent_variance += 1.0 / weights.effective - 1.0 / count;
        memory.generations += 1;
        let shape = Shape::of(&population.points, &weights.normalised)?;
        let parents = draw(&weights.normalised, &mut stream.generator());
        let evaluations = population.evaluations;
        *population = population.select(&parents);
        population.evaluations = evaluations;
        memory.families = parents.iter().map(|&i| memory.families[i]).collect();
        Ok(shape)
    }
}
