//! Intervals of an estimated probability.

use lacuna::math::special::inverse_beta;

/// 97.5 % quantile of the standard normal distribution.
const TWO_SIDED: f64 = 1.959_963_984_540_054;

/// The 95 % interval of an estimate with this coefficient of variation whose logarithm is normal; an estimate by sampling
/// has a longer upper tail than a normal distribution.
pub fn log_normal(probability: f64, variation: f64) -> [f64; 2] {
    let width = TWO_SIDED * (variation * variation).ln_1p().sqrt();
    [probability * (-width).exp(), (probability * width.exp()).min(1.0)]
}

/// The 95 % interval of a binomial probability (Clopper and Pearson, Biometrika 26 (1934) 404).
pub fn clopper_pearson(failures: usize, count: usize) -> [f64; 2] {
    let (k, n) = (failures as f64, count as f64);
    let low = if failures == 0 { 0.0 } else { inverse_beta(k, n - k + 1.0, 0.025, 0.975).0 };
    let high = if failures >= count { 1.0 } else { inverse_beta(k + 1.0, n - k, 0.975, 0.025).0 };
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.stats.binomtest(k, n).proportion_ci(method="exact")`, `SciPy` 1.
    #[test]
    fn the_exact_interval_is_that_of_scipy() {
        for (k, n, low, high) in [
            (0, 100, 0.0, 0.036_216_692_645_190_54),
            (5, 100, 0.016_431_879_181_728_278, 0.112_834_911_105_462_88),
            (100, 100, 0.963_783_307_354_809_4, 1.0),
        ] {
            let found = clopper_pearson(k, n);
            assert!((found[0] - low).abs() < 1e-9 && (found[1] - high).abs() < 1e-9, "{found:?}");
        }
    }
}
