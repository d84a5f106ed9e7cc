//! Binomial counts: exact confidence intervals, and acceptance bands of a count.

use crate::math::distribution::Distribution;
use crate::math::special::ln_gamma;

/// Confidence interval of a probability from `k` successes in `n` trials (Clopper and Pearson, Biometrika 26 (1934)
/// 404).
///
/// The counts need not be whole numbers, so that dependent trials can be given by their effective number (Korn and
/// Graubard, Survey Methodology 24 (1998) 193). From 0 to 1 if `n` is zero.
pub fn interval(k: f64, n: f64, level: f64) -> [f64; 2] {
    if n <= 0.0 {
        return [0.0, 1.0];
    }
    let tail = 0.5 * (1.0 - level);
    let quantile = |a: f64, b: f64, p: f64| Distribution::Beta([a, b, 0.0, 1.0]).quantile(p);
    let low = if k > 0.0 { quantile(k, n - k + 1.0, tail) } else { 0.0 };
    let high = if k < n { quantile(k + 1.0, n - k, 1.0 - tail) } else { 1.0 };
    [low, high]
}

/// Probability of `k` successes in `n` trials.
pub fn probability(k: usize, n: usize, p: f64) -> f64 {
    if p <= 0.0 || p >= 1.0 {
        let sure = if p <= 0.0 { 0 } else { n };
        return f64::from(u8::from(k == sure));
    }
    let (kf, nf) = (k as f64, n as f64);
    let ways = ln_gamma(nf + 1.0) - ln_gamma(kf + 1.0) - ln_gamma(nf - kf + 1.0);
    (ways + kf * p.ln() + (nf - kf) * (-p).ln_1p()).exp()
}

/// Smallest and largest count in `n` trials with success probability `p` such that neither tail beyond them exceeds
/// `tail`.
pub fn band(n: usize, p: f64, tail: f64) -> [usize; 2] {
    let all: Vec<f64> = (0..=n).map(|k| probability(k, n, p)).collect();
    [beyond(all.iter(), tail), n - beyond(all.iter().rev(), tail)]
}

/// Number of leading terms whose sum does not exceed `tail`.
fn beyond<'a>(terms: impl Iterator<Item = &'a f64>, tail: f64) -> usize {
    let mut sum = 0.0;
    terms
        .take_while(|&&term| {
            sum += term;
            // The tolerance keeps rounding of the sum from deciding the comparison.
            sum <= tail * (1.0 - 1e-9)
        })
        .count()
}

/// Probabilities of 0, 1, …, n successes in independent trials with these success probabilities (Poisson binomial).
pub fn of_unlike(probabilities: &[f64]) -> Vec<f64> {
    let mut all = vec![1.0];
    for &p in probabilities {
        let mut next = vec![0.0; all.len() + 1];
        for (k, q) in all.iter().enumerate() {
            next[k] += q * (1.0 - p);
            next[k + 1] += q * p;
        }
        all = next;
    }
    all
}

/// Two-sided p-value of a count of trials with these success probabilities: twice the smaller tail that includes the
/// count.
pub fn two_sided(count: usize, probabilities: &[f64]) -> f64 {
    let all = of_unlike(probabilities);
    let low: f64 = all[..=count].iter().sum();
    let high: f64 = all[count..].iter().sum();
    (2.0 * low.min(high)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Source: roots of the binomial tails, found by bisection of exact sums in Python; the first also from R's
    /// `binom.test(9, 200)`.
    #[test]
    fn the_interval_is_that_of_clopper_and_pearson() {
        for (k, n, level, low, high) in [
            (9.0, 200.0, 0.95, 0.020_780_4, 0.083_702_7),
            (0.0, 30.0, 0.95, 0.0, 0.115_703_3),
            (30.0, 30.0, 0.95, 0.884_296_7, 1.0),
        ] {
            let found = interval(k, n, level);
            assert!((found[0] - low).abs() < 2e-6 && (found[1] - high).abs() < 2e-6, "{found:?}");
        }
    }

    /// Source: 0.5 % and 99.5 % quantiles of the binomial law, from exact sums in Python.
    #[test]
    fn the_band_holds_the_counts_that_chance_allows() {
        assert_eq!(band(200, 0.95, 0.005), [181, 197]);
        assert_eq!(band(200, 0.5, 0.005), [82, 118]);
        assert_eq!(band(5, 0.95, 0.005), [3, 5]);
        assert_eq!(band(0, 0.95, 0.005), [0, 0]);
    }

    #[test]
    fn trials_of_unlike_probability_have_the_law_of_their_sum() {
        let all = of_unlike(&[0.5, 0.5, 0.5]);
        for (found, expected) in all.iter().zip([0.125, 0.375, 0.375, 0.125]) {
            assert!((found - expected).abs() < 1e-15);
        }
        let mixed = of_unlike(&[0.1, 1.0]);
        assert!((mixed[1] - 0.9).abs() < 1e-15 && mixed[0] == 0.0);
        assert!((two_sided(0, &[0.5; 10]) - 2.0 / 1024.0).abs() < 1e-15);
    }
}
