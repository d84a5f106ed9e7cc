//! Prior volumes of dead and live points.
//!
//! Of `n` points spread evenly over a volume, the lowest leaves a share `t` of it above, whose
//! logarithm has the mean `-1 / n` (Skilling 2006, section 3). In one step the points die with
//! `K, K - 1, ..., K - K/2 + 1` alive; then the living are `K` again; at the end of the run the rest die one by
//! one.

use lacuna::math::moments::variance;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::math::special::ln_one_minus_exp;

/// The log of the volume between the lowest of `alive` points and the one before, and that above it.
pub(super) fn shell(log_volume: f64, alive: usize) -> (f64, f64) {
    cut(log_volume, -1.0 / alive as f64)
}

/// The logs of the volumes of a shell and of what it encloses, given the log of the enclosed share.
fn cut(log_volume: f64, log_share: f64) -> (f64, f64) {
    (log_volume + ln_one_minus_exp(log_share), log_volume + log_share)
}

/// Points in the order of their deaths.
pub(super) struct Ladder<'a> {
    /// How many died before those that are listed.
    pub forgotten: usize,
    /// The log-likelihoods of the others.
    pub rungs: &'a [f64],
    /// The number of live points.
    pub live: usize,
    /// Whether the last `live` rungs are the living.
    pub ended: bool,
}

impl Ladder<'_> {
    /// How many are alive when a point dies.
    fn alive(&self, index: usize) -> usize {
        let total = self.forgotten + self.rungs.len();
        if self.ended && index + self.live >= total {
            total - index
        } else {
            self.live - index % (self.live / 2)
        }
    }

    /// The log weight of each rung, from the log of the volume before the first and that of the share
    /// which a number of points alive leaves.
    fn weights(&self, before: f64, mut share: impl FnMut(usize) -> f64) -> Vec<f64> {
        let mut volume = before;
        let weight = |(i, rung): (usize, &f64)| {
            let (width, next) = cut(volume, share(self.alive(self.forgotten + i)));
            volume = next;
            rung + width
        };
        self.rungs.iter().enumerate().map(weight).collect()
    }

    /// The sum over the forgotten of a power of the number alive.
    fn sum_of_forgotten(&self, power: i32) -> f64 {
        (0..self.forgotten).map(|i| (self.alive(i) as f64).powi(power)).sum()
    }

    /// The log weight of each rung, likelihood times width, for the mean volumes.
    pub fn mean_weights(&self) -> Vec<f64> {
        self.weights(-self.sum_of_forgotten(-1), |alive| -1.0 / alive as f64)
    }

    /// The standard deviation of the log evidence over `count` sequences of volumes drawn from their
    /// law: the largest of `n` uniform numbers is `u^(1/n)`, and the product of the many shares of the
    /// forgotten is log-normal.
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

/// The log of the sum of exponentials.
pub(super) fn log_sum(logs: &[f64]) -> f64 {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + logs.iter().map(|l| (l - largest).exp()).sum::<f64>().ln()
}
