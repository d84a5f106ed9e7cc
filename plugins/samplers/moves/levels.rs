//! Groups of points of similar likelihood, each with its own length and shape of steps.
//!
//! If an unknown variance decreases with the misfit, a population on its way to a concentrated posterior spans many
//! orders of magnitude: a funnel, whose neck no step with the length of the mouth enters. Points of similar
//! likelihood have a similar spread, so that their differences are steps of a suitable length.

use lacuna::math::random::{below, uniform};
use rand::Rng;

use super::Evaluated;

/// Maximum number of groups.
const MOST: usize = 8;
/// Minimum number of points of a group per dimension; fewer do not span the space reliably.
const POINTS: usize = 8;

/// Points in groups of equal size, ordered by likelihood.
pub(super) struct Levels {
    /// Indices of the points, from the lowest likelihood to the highest.
    rising: Vec<usize>,
    /// Lowest log-likelihood of each group except the first.
    bounds: Vec<f64>,
}

impl Levels {
    /// Groups points by likelihood.
    pub fn of(points: &Evaluated) -> Self {
        let likelihood = points.log_likelihoods();
        let mut rising: Vec<usize> = (0..likelihood.len()).collect();
        rising.sort_by(|&a, &b| likelihood[a].total_cmp(&likelihood[b]));
        let least = POINTS * (points.points.columns() + 1);
        let count = (rising.len() / least).clamp(1, MOST);
        let bound = |level: usize| likelihood[rising[level * rising.len() / count]];
        Self { bounds: (1..count).map(bound).collect(), rising }
    }

    /// Returns the number of groups.
    pub fn count(&self) -> usize {
        self.bounds.len() + 1
    }

    /// Returns the indices of all points.
    pub fn all(&self) -> &[usize] {
        &self.rising
    }

    /// Returns the indices of the points of one group.
    pub fn members(&self, level: usize) -> &[usize] {
        let n = self.rising.len();
        &self.rising[level * n / self.count()..(level + 1) * n / self.count()]
    }

    /// Returns the group to which a log-likelihood belongs.
    fn level(&self, log_likelihood: f64) -> usize {
        self.bounds.partition_point(|bound| *bound <= log_likelihood)
    }

    /// Chooses a group for the step of a point with this log-likelihood: with the highest probability its own, and
    /// half that for each group farther away.
    pub fn choose(&self, log_likelihood: f64, rng: &mut impl Rng) -> usize {
        let mut left = uniform(rng) * self.sum(log_likelihood);
        (0..self.count() - 1)
            .find(|&level| {
                left -= self.weight(level, log_likelihood);
                left < 0.0
            })
            .unwrap_or(self.count() - 1)
    }

    /// Returns the log of the probability of choosing `level`.
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

/// Draws two distinct indices below `places`.
pub(super) fn pair(places: usize, rng: &mut impl Rng) -> (usize, usize) {
    let first = below(rng, places);
    (first, (first + 1 + below(rng, places - 1)) % places)
}
