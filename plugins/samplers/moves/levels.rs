//! Groups of points of similar likelihood, in each of which steps have a length and a shape of their own.
//!
//! Where an unknown variance goes down with the misfit, a population on its way to a concentrated posterior
//! spans many orders of magnitude: a funnel, whose neck no step of the mouth's length enters. Points of similar
//! likelihood are of similar width, so that their differences are steps that suit them.

use lacuna::math::random::{below, uniform};
use rand::Rng;

use super::Evaluated;

/// The most groups.
const MOST: usize = 8;
/// The fewest points of a group for each dimension: fewer do not span the space well.
const POINTS: usize = 8;

/// Points in groups of equal size, in the order of their likelihood.
pub(super) struct Levels {
    /// The places of the points, from the lowest likelihood to the highest.
    rising: Vec<usize>,
    /// The lowest likelihood of each group but the first.
    bounds: Vec<f64>,
}

impl Levels {
    /// The groups of these points.
    pub fn of(points: &Evaluated) -> Self {
        let likelihood = points.log_likelihoods();
        let mut rising: Vec<usize> = (0..likelihood.len()).collect();
        rising.sort_by(|&a, &b| likelihood[a].total_cmp(&likelihood[b]));
        let least = POINTS * (points.points.columns() + 1);
        let count = (rising.len() / least).clamp(1, MOST);
        let bound = |level: usize| likelihood[rising[level * rising.len() / count]];
        Self { bounds: (1..count).map(bound).collect(), rising }
    }

    /// The number of groups.
    pub fn count(&self) -> usize {
        self.bounds.len() + 1
    }

    /// The places of all points.
    pub fn all(&self) -> &[usize] {
        &self.rising
    }

    /// The places of the points of one group.
    pub fn members(&self, level: usize) -> &[usize] {
        let n = self.rising.len();
        &self.rising[level * n / self.count()..(level + 1) * n / self.count()]
    }

    /// The group to which a likelihood belongs.
    fn level(&self, log_likelihood: f64) -> usize {
        self.bounds.partition_point(|bound| *bound <= log_likelihood)
    }

    /// A group for the step of a point with this likelihood: its own, or less often another, the less often the
    /// farther away.
    pub fn choose(&self, log_likelihood: f64, rng: &mut impl Rng) -> usize {
        let mut left = uniform(rng) * self.sum(log_likelihood);
        (0..self.count() - 1)
            .find(|&level| {
                left -= self.weight(level, log_likelihood);
                left < 0.0
            })
            .unwrap_or(self.count() - 1)
    }

    /// The log of the probability of that choice.
    pub fn ln_chance(&self, level: usize, log_likelihood: f64) -> f64 {
        (self.weight(level, log_likelihood) / self.sum(log_likelihood)).ln()
    }

    fn weight(&self, level: usize, log_likelihood: f64) -> f64 {
        0.5_f64.powi(level.abs_diff(self.level(log_likelihood)) as i32)
    }

    fn sum(&self, log_likelihood: f64) -> f64 {
        (0..self.count()).map(|level| self.weight(level, log_likelihood)).sum()
    }
}

/// Two different places.
pub(super) fn pair(places: usize, rng: &mut impl Rng) -> (usize, usize) {
    let first = below(rng, places);
    (first, (first + 1 + below(rng, places - 1)) % places)
}
