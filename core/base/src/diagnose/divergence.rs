//! The Kullback-Leibler divergence of a known density from the unknown density of draws.

use crate::math::moments::{mean, variance};
use crate::math::special::{ln_gamma, ln_minus_digamma};

/// An estimate with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Divergence {
    /// Estimate, in nats; negative values are estimation error.
    pub value: f64,
    /// Standard error.
    pub error: f64,
}

/// Number of the neighbour whose distance measures the density of the draws.
const NEIGHBOUR: usize = 4;

/// Estimates the divergence from independent draws and the logarithm of the known density at each: the draws' entropy is that
/// of Kozachenko and Leonenko (Problems of Information Transmission 23 (1987) 95), from the distances of the fourth
/// neighbours. The bias grows with the dimension; the estimate is useful up to about ten.
pub fn divergence(draws: &[Vec<f64>], log_density: &[f64]) -> Divergence {
    let (n, d) = (draws.len(), draws.first().map_or(0, Vec::len));
    let distance =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    let term = |i: usize| {
        let mut all: Vec<f64> = draws.iter().map(|other| distance(&draws[i], other)).collect();
        // The draw itself is its own first neighbour.
        let place = NEIGHBOUR.min(n - 1);
        let (_, square, _) = all.select_nth_unstable_by(place, f64::total_cmp);
        -0.5 * d as f64 * square.max(f64::MIN_POSITIVE).ln() - log_density[i]
    };
    let terms: Vec<f64> = (0..n).map(term).collect();
    let digamma = |x: usize| (x as f64).ln() - ln_minus_digamma(x as f64).0;
    let half = 0.5 * d as f64;
    let log_ball = half * std::f64::consts::PI.ln() - ln_gamma(half + 1.0);
    Divergence {
        value: mean(&terms) + digamma(NEIGHBOUR) - digamma(n) - log_ball,
        error: (variance(&terms) / n as f64).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{Stream, normal};
    use crate::math::special::HALF_LN_TWO_PI;

    /// The divergence of normal distributions whose means differ by `shift` is `shift^2 / 2` (Kullback 1959).
    #[test]
    fn the_divergence_of_normal_distributions_is_found() {
        for (seed, shift) in [(1, 0.0), (2, 0.5), (3, 1.0)] {
            let mut rng = Stream::root(seed).generator();
            let draws: Vec<Vec<f64>> =
                (0..1500).map(|_| vec![shift + normal(&mut rng), normal(&mut rng)]).collect();
            let normal = |z: &Vec<f64>| -0.5 * (z[0] * z[0] + z[1] * z[1]) - 2.0 * HALF_LN_TWO_PI;
            let log_density: Vec<f64> = draws.iter().map(normal).collect();
            let found = divergence(&draws, &log_density);
            let off = found.value - 0.5 * shift * shift;
            assert!(off.abs() < 4.0 * found.error, "{shift}: {off} {found:?}");
            assert!(found.error < 0.05);
        }
    }
}
