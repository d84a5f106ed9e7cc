//! Uniformity of ranks: simultaneous confidence bands of the empirical distribution function of a uniform sample
//! (Säilynoja, Bürkner and Vehtari, Statistics and Computing 32 (2022) 32).

use crate::math::special::ln_gamma;

/// Simultaneous band of the empirical distribution function of uniform numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// Probability of each tail at a single point that gives the whole band its level.
    pub tail: f64,
    /// Points at which the distribution function is evaluated.
    pub points: Vec<f64>,
    /// Smallest and largest number of values up to each point.
    pub counts: Vec<[usize; 2]>,
}

/// The band that a sample of `n` independent uniform numbers leaves at any of these points with probability
/// `1 - level`. The points increase from above 0 to 1 and are the possible values of a rank.
///
/// The probability that the sample stays inside is computed exactly, by a recursion over the points and the counts
/// inside (section 2.2 of the paper); the tail probability at one point is found by bisection.
pub fn band(n: usize, points: &[f64], level: f64) -> Band {
    let factorials = Factorials::upto(n);
    let (mut small, mut large) = (0.0_f64, 1.0 - level);
    // A smaller tail gives a wider band. Counts are integers, so the level is approached from above.
    for _ in 0..30 {
        let tail = 0.5 * (small + large);
        let counts = counts(n, points, tail);
        if inside(&factorials, n, points, &counts) >= level {
            small = tail;
        } else {
            large = tail;
        }
    }
    Band { tail: small, points: points.to_vec(), counts: counts(n, points, small) }
}

fn counts(n: usize, points: &[f64], tail: f64) -> Vec<[usize; 2]> {
    points.iter().map(|&z| super::binomial::band(n, z, tail)).collect()
}

/// Logarithms of factorials.
struct Factorials(Vec<f64>);

impl Factorials {
    fn upto(n: usize) -> Self {
        Self((0..=n).map(|k| ln_gamma(k as f64 + 1.0)).collect())
    }

    /// Probability of `k` of `n`, given the logarithms of p and of 1 - p.
    fn binomial(&self, k: usize, n: usize, [ln_p, ln_q]: [f64; 2]) -> f64 {
        // Zero factors contribute one, even if the probability is zero and its logarithm infinite.
        let power = |count: usize, ln: f64| if count == 0 { 0.0 } else { count as f64 * ln };
        let ways = self.0[n] - self.0[k] - self.0[n - k];
        (ways + power(k, ln_p) + power(n - k, ln_q)).exp()
    }
}

/// Probability that a uniform sample has counts inside the band at every point.
fn inside(factorials: &Factorials, n: usize, points: &[f64], counts: &[[usize; 2]]) -> f64 {
    let mut law = vec![1.0];
    let (mut first, mut before) = (0, 0.0);
    for (&z, &[low, high]) in points.iter().zip(counts) {
        // Each value beyond the previous point lies below this one with the same probability.
        let share =
            if before < 1.0 { ((z - before) / (1.0 - before)).clamp(0.0, 1.0) } else { 0.0 };
        let logs = [share.ln(), (-share).ln_1p()];
        let next = (low..=high).map(|k| {
            let from = law.iter().enumerate().filter(|(i, _)| first + i <= k);
            from.map(|(i, q)| q * factorials.binomial(k - first - i, n - first - i, logs)).sum()
        });
        (law, first, before) = (next.collect(), low, z);
    }
    law.iter().sum()
}

impl Band {
    /// Points at which the sample's counts leave the band.
    pub fn left_at(&self, values: &[f64]) -> Vec<f64> {
        let out = |(&z, &[low, high]): (&f64, &[usize; 2])| {
            let count = values.iter().filter(|&&v| v <= z + 1e-12).count();
            (count < low || count > high).then_some(z)
        };
        self.points.iter().zip(&self.counts).filter_map(out).collect()
    }
}

/// Number of values in each of `bins` equal bins of (0, 1].
pub fn histogram(values: &[f64], bins: usize) -> Vec<usize> {
    let mut counts = vec![0; bins];
    for value in values {
        let bin = (value * bins as f64 - 1e-9).floor().max(0.0) as usize;
        counts[bin.min(bins - 1)] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{Stream, uniform};

    /// The fraction of uniform samples that leave the band is within four standard errors of its level.
    #[test]
    fn the_band_holds_as_many_uniform_samples_as_it_says() {
        let points: Vec<f64> = (1..=50).map(|i| f64::from(i) / 50.0).collect();
        let band = band(100, &points, 0.95);
        let samples = 4000_u32;
        let stays = |k: u32| {
            let mut rng = Stream::root(11).at(u64::from(k)).generator();
            let values: Vec<f64> = (0..100).map(|_| uniform(&mut rng)).collect();
            band.left_at(&values).is_empty()
        };
        let kept = (0..samples).filter(|&k| stays(k)).count() as f64 / f64::from(samples);
        let exact = inside(&Factorials::upto(100), 100, &points, &band.counts);
        let error = (exact * (1.0 - exact) / f64::from(samples)).sqrt();
        assert!((kept - exact).abs() < 4.0 * error, "{kept} {exact}");
        assert!((0.95..0.97).contains(&exact), "{exact}");
    }

    /// One point is an ordinary binomial test.
    #[test]
    fn at_one_point_the_band_is_that_of_the_binomial_law() {
        let one = band(200, &[0.5], 0.99);
        assert_eq!(one.counts, [super::super::binomial::band(200, 0.5, 0.005)]);
    }

    #[test]
    fn ranks_that_pile_up_at_the_ends_leave_the_band() {
        let points: Vec<f64> = (1..=20).map(|i| f64::from(i) / 20.0).collect();
        let band = band(100, &points, 0.99);
        let even: Vec<f64> = (0..100).map(|i| (f64::from(i) + 0.5) / 100.0).collect();
        assert_eq!(band.left_at(&even), [] as [f64; 0]);
        let piled: Vec<f64> = even
            .iter()
            .map(|u| 0.5 + 0.5 * (2.0 * u - 1.0).signum() * (2.0 * u - 1.0).abs().powf(0.3))
            .collect();
        assert!(!band.left_at(&piled).is_empty());
        assert_eq!(histogram(&even, 4), [25, 25, 25, 25]);
    }
}
