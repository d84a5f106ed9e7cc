//! Prior volumes of removed and live points.
//!
//! Of `n` points uniformly distributed over a volume, the lowest leaves a fraction `t` of it above, whose logarithm
//! has the mean `-1 / n` (Skilling 2006, section 3). In one step the points are removed with
//! `K, K - 1, ..., K - K/2 + 1` live; then there are `K` again. At the end of the run the rest is removed one by one.

use lacuna::math::moments::variance;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::math::special::ln_one_minus_exp;

/// Returns the logs of the volume between the lowest of `alive` points and the one before, and of the volume above
/// it.
pub(super) fn shell(log_volume: f64, alive: usize) -> (f64, f64) {
    cut(log_volume, -1.0 / alive as f64)
}

/// Returns the logs of the volumes of a shell and of what it encloses, given the log of the enclosed fraction.
fn cut(log_volume: f64, log_share: f64) -> (f64, f64) {
    (log_volume + ln_one_minus_exp(log_share), log_volume + log_share)
}

/// Points in the order of removal.
pub(super) struct Ladder<'a> {
    /// Number of points removed before those in `rungs`, and dropped from memory.
    pub forgotten: usize,
    /// Log-likelihoods of the other points.
    pub rungs: &'a [f64],
    /// Number of live points.
    pub live: usize,
    /// True if the last `live` rungs are the live points at the end of the run.
    pub ended: bool,
}

impl Ladder<'_> {
    /// Returns the number of live points at the removal of point `index`.
    fn alive(&self, index: usize) -> usize {
        let total = self.forgotten + self.rungs.len();
        if self.ended && index + self.live >= total {
            total - index
        } else {
            self.live - index % (self.live / 2)
        }
    }

    /// Returns the log weight of each rung. `before` is the log of the volume before the first one; `share` gives the
    /// log of the fraction that is left with a number of live points.
    fn weights(&self, before: f64, mut share: impl FnMut(usize) -> f64) -> Vec<f64> {
        let mut volume = before;
        let weight = |(i, rung): (usize, &f64)| {
            let (width, next) = cut(volume, share(self.alive(self.forgotten + i)));
            volume = next;
            rung + width
        };
        self.rungs.iter().enumerate().map(weight).collect()
    }

    /// Returns the sum of a power of the number of live points over the dropped points.
    fn sum_of_forgotten(&self, power: i32) -> f64 {
        (0..self.forgotten).map(|i| (self.alive(i) as f64).powi(power)).sum()
    }

    /// Returns the log weight of each rung, likelihood times width of the shell, for the expected log volumes.
    pub fn mean_weights(&self) -> Vec<f64> {
        self.weights(-self.sum_of_forgotten(-1), |alive| -1.0 / alive as f64)
    }

    /// Returns the standard deviation of the log evidence over `count` random sequences of volumes: the largest of
    /// `n` uniform numbers is distributed as `u^(1/n)`, and the product of the many fractions of the dropped points
    /// as a log-normal number.
    pub fn scatter(&self, count: usize, stream: &Stream) -> f64 {
        let (centre, spread) = (-self.sum_of_forgotten(-1), self.sum_of_forgotten(-2).sqrt());
        let evidence = |k: usize| {
            let mut rng = stream.at(k as u64).generator();
            let before = centre + spread * normal(&mut rng);
            log_sum(&self.weights(before, |alive| uniform(&mut rng).ln() / alive as f64))
        };
        variance(&(0..count).map(evidence).collect::<Vec<f64>>()).sqrt()
    }
}

/// Returns the log of the sum of exponentials, shifted by the largest so that none overflows.
pub(super) fn log_sum(logs: &[f64]) -> f64 {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + logs.iter().map(|l| (l - largest).exp()).sum::<f64>().ln()
}
