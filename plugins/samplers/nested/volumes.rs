//! Prior volumes of dead and live points.
//!
//! Of `n` points spread evenly over a volume, the lowest leaves a share `t` of it above, whose
//! logarithm has the mean `-1 / n` (Skilling 2006, section 3). In one step the points die with
//! `K, K - 1, ..., K - K/2 + 1` alive; then the living are `K` again; at the end of the run the rest die one by
//! one.

use lacuna::math::random::{Stream, uniform};
use lacuna::math::special::ln_one_minus_exp;
use rand::Rng;

/// The log of the volume between the lowest of `alive` points and the one before, and that above it.
pub(super) fn shell(log_volume: f64, alive: usize) -> (f64, f64) {
    cut(log_volume, -1.0 / alive as f64)
}

/// The logs of the volumes of a shell and of what it encloses, given the log of the enclosed share.
fn cut(log_volume: f64, log_share: f64) -> (f64, f64) {
    (log_volume + ln_one_minus_exp(log_share), log_volume + log_share)
}

/// How many points are alive when each of `dead` points dies in steps that replace half of `live`.
fn alive(dead: usize, live: usize) -> impl Iterator<Item = usize> {
    (0..dead).map(move |i| live - i % (live / 2))
}

/// The log weight, likelihood times width, of each dead point.
pub(super) fn log_weights(dead: &[f64], live: usize) -> Vec<f64> {
    let mut volume = 0.0;
    let weight = |(likelihood, alive): (&f64, usize)| {
        let (width, next) = shell(volume, alive);
        volume = next;
        likelihood + width
    };
    dead.iter().zip(alive(dead.len(), live)).map(weight).collect()
}

/// All points of a run in rising order, the last `live` of them alive at its end.
pub(super) struct Ladder<'a> {
    /// Their log-likelihoods.
    pub rungs: &'a [f64],
    /// The number of live points.
    pub live: usize,
}

impl Ladder<'_> {
    fn alive(&self) -> impl Iterator<Item = usize> {
        let dead = self.rungs.len() - self.live;
        alive(dead, self.live).chain((1..=self.live).rev())
    }

    /// The log weight of each rung, when `share` gives the log of the enclosed share from the number alive.
    fn weights(&self, mut share: impl FnMut(usize) -> f64) -> Vec<f64> {
        let mut volume = 0.0;
        let weight = |(rung, alive): (&f64, usize)| {
            let (width, next) = cut(volume, share(alive));
            volume = next;
            rung + width
        };
        self.rungs.iter().zip(self.alive()).map(weight).collect()
    }

    /// The log weight of each rung for the mean volumes.
    pub fn mean_weights(&self) -> Vec<f64> {
        self.weights(|alive| -1.0 / alive as f64)
    }

    /// The standard deviation of the log evidence over `count` sequences of volumes drawn from their
    /// law: the largest of `n` uniform numbers is `u^(1/n)`.
    pub fn scatter(&self, count: usize, stream: &Stream) -> f64 {
        let evidences: Vec<f64> = (0..count)
            .map(|k| {
                let mut rng = stream.at(k as u64).generator();
                log_sum(&self.weights(|alive| log_share(alive, &mut rng)))
            })
            .collect();
        lacuna::math::moments::variance(&evidences).sqrt()
    }
}

fn log_share(alive: usize, rng: &mut impl Rng) -> f64 {
    uniform(rng).ln() / alive as f64
}

/// The log of the sum of exponentials.
pub(super) fn log_sum(logs: &[f64]) -> f64 {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + logs.iter().map(|l| (l - largest).exp()).sum::<f64>().ln()
}
