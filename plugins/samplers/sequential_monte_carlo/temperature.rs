//! One change of temperature: weights, evidence, and resampling.

use lacuna::math::random::{Stream, uniform};
use lacuna::run::Stop;
use rand::Rng;

use super::{Evaluated, Memory, SequentialMonteCarlo, Shape};

/// Importance weights of particles.
pub(super) struct Weights {
    /// Weights, normalised to sum to 1.
    pub normalised: Vec<f64>,
    /// Log of the mean of the weights before normalisation.
    pub log_mean: f64,
    /// Effective number of particles, `(sum w)^2 / sum w^2`.
    pub effective: f64,
}

impl Weights {
    /// Computes the weights `likelihood^power`.
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

/// Returns the largest increase of the power, at most `rest`, that leaves `effective` particles effective.
pub(super) fn increase(log_likelihood: &[f64], effective: f64, rest: f64) -> f64 {
    let enough = |power: f64| Weights::new(log_likelihood, power).effective >= effective;
    if enough(rest) {
        return rest;
    }
    // The effective number decreases over many orders of magnitude of the power: bisection in its logarithm.
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

/// Draws indices independently in proportion to the weights (multinomial resampling), in ascending order.
///
/// Systematic resampling would have less variance, but the error estimate from the genealogy is not valid for it.
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
    /// Raises the power as far as the weights allow and resamples the particles; returns the shape of the weighted
    /// particles.
    pub(super) fn cool(
        &self,
        population: &mut Evaluated,
        memory: &mut Memory,
        stream: &Stream,
    ) -> Result<Shape, Stop> {
        let log_likelihood = population.log_likelihoods();
        let (count, rest) = (self.particles as f64, 1.0 - memory.temperature);
        let power = increase(&log_likelihood, self.effective_share * count, rest);
        // Without the first case rounding could leave the temperature just below 1, and the run would not end.
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
