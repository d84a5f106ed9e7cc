//! Moments, quantiles and density estimates of samples.

use serde::{Deserialize, Serialize};

use crate::matrix::Matrix;

/// Running mean and covariance of points (Welford, 1962).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    count: u64,
    mean: Vec<f64>,
    /// Sums of products of deviations from the mean: lower triangle, row by row.
    products: Vec<f64>,
}

impl Moments {
    /// Moments of zero points of this dimension.
    pub fn new(dimension: usize) -> Self {
        let products = vec![0.0; dimension * (dimension + 1) / 2];
        Self { count: 0, mean: vec![0.0; dimension], products }
    }

    /// Moments of the rows of a matrix, `points x dimension`.
    pub fn of_rows(points: &Matrix) -> Self {
        let mut moments = Self::new(points.columns());
        points.iter_rows().for_each(|row| moments.add(row));
        moments
    }

    /// Adds one point.
    pub fn add(&mut self, point: &[f64]) {
        self.count += 1;
        // Welford's update multiplies deviations from the old and the new mean, which avoids the cancellation of sums
        // of squares far from zero.
        let before: Vec<f64> = point.iter().zip(&self.mean).map(|(x, m)| x - m).collect();
        for (mean, deviation) in self.mean.iter_mut().zip(&before) {
            *mean += deviation / self.count as f64;
        }
        let after: Vec<f64> = point.iter().zip(&self.mean).map(|(x, m)| x - m).collect();
        let mut k = 0;
        for i in 0..point.len() {
            for &other in &after[..=i] {
                self.products[k] += before[i] * other;
                k += 1;
            }
        }
    }

    /// Number of points.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean of each coordinate.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// Covariance with divisor `count - 1`, `dimension x dimension`; zero for fewer than two points.
    pub fn covariance(&self) -> Matrix {
        let divisor = self.count.saturating_sub(1).max(1) as f64;
        Matrix::from_fn(self.mean.len(), self.mean.len(), |i, j| {
            let (i, j) = if i < j { (j, i) } else { (i, j) };
            self.products[i * (i + 1) / 2 + j] / divisor
        })
    }

    /// Standard deviation of each coordinate.
    pub fn sd(&self) -> Vec<f64> {
        let covariance = self.covariance();
        (0..self.mean.len()).map(|i| covariance[(i, i)].sqrt()).collect()
    }

    /// Correlation matrix; off-diagonal entries of a constant coordinate are zero.
    pub fn correlation(&self) -> Matrix {
        let (covariance, sd) = (self.covariance(), self.sd());
        Matrix::from_fn(sd.len(), sd.len(), |i, j| match (i == j, sd[i] * sd[j] > 0.0) {
            (true, _) => 1.0,
            (_, true) => (covariance[(i, j)] / (sd[i] * sd[j])).clamp(-1.0, 1.0),
            _ => 0.0,
        })
    }
}

/// Share of the mean deviation that a mean may be off by.
const LOST: f64 = 1e-6;

/// Arithmetic mean; NaN for an empty slice.
///
/// A sum of many values that are large against their differences loses these. Where that can matter, the mean of the deviations
/// corrects the first estimate, as in the two-pass algorithm of Chan and others, The American Statistician 37 (1983) 242.
pub fn mean(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let estimate = values.iter().sum::<f64>() / count;
    if !estimate.is_finite() {
        return estimate;
    }
    let deviations = || values.iter().map(|x| x - estimate);
    // Each of the additions rounds by half a unit in the last place of the sum at most.
    let lost = 0.5 * count * f64::EPSILON * estimate.abs();
    if lost <= LOST * deviations().map(f64::abs).sum::<f64>() / count {
        return estimate;
    }
    estimate + deviations().sum::<f64>() / count
}

/// Sample variance with divisor `n - 1`; NaN for fewer than two values.
pub fn variance(values: &[f64]) -> f64 {
    let centre = mean(values);
    values.iter().map(|x| (x - centre).powi(2)).sum::<f64>() / (values.len() as f64 - 1.0)
}

/// Logarithm of the sum of exponentials, without overflow.
pub fn log_sum(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return largest;
    }
    largest + logs.map(|l| (l - largest).exp()).sum::<f64>().ln()
}

/// The values in ascending order.
pub fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// Quantile of a sorted sample, linear between order statistics: type 7 of Hyndman and Fan (1996), the default of numpy
/// and R. NaN for an empty sample.
pub fn quantile(sorted: &[f64], p: f64) -> f64 {
    if sorted.is_empty() {
        return f64::NAN;
    }
    let place = p.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

/// Like [`quantile`], of a sample in any order, which is reordered: faster than sorting for few quantiles.
pub fn quantile_of(values: &mut [f64], p: f64) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let place = p.clamp(0.0, 1.0) * (values.len() - 1) as f64;
    let below = place.floor() as usize;
    let (_, low, greater) = values.select_nth_unstable_by(below, f64::total_cmp);
    let low = *low;
    let high = greater.iter().copied().min_by(f64::total_cmp).unwrap_or(low);
    low + (place - below as f64) * (high - low)
}

/// Histogram with bins of equal width.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Histogram {
    /// Edges of the bins, one more than there are bins.
    pub edges: Vec<f64>,
    /// Number of values in each bin; a value on an inner edge belongs to the upper bin, one on the last edge to the
    /// last bin.
    pub counts: Vec<u64>,
}

impl Histogram {
    /// A histogram with the bin width of Freedman and Diaconis (1981), or of Scott (1979) if the quartiles coincide; at
    /// most 200 bins. Non-finite values are left out.
    pub fn of(values: &[f64]) -> Self {
        let finite: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
        let ordered = sorted(&finite);
        let (Some(&lo), Some(&hi)) = (ordered.first(), ordered.last()) else {
            return Self { edges: Vec::new(), counts: Vec::new() };
        };
        if lo == hi {
            // A constant sample has no width; one bin of width one keeps the density finite.
            return Self { edges: vec![lo - 0.5, hi + 0.5], counts: vec![ordered.len() as u64] };
        }
        let root = (ordered.len() as f64).cbrt();
        let quartiles = quantile(&ordered, 0.75) - quantile(&ordered, 0.25);
        let width = if quartiles > 0.0 {
            2.0 * quartiles / root
        } else {
            (24.0 * std::f64::consts::PI.sqrt()).cbrt() * variance(&ordered).sqrt() / root
        };
        let bins = ((hi - lo) / width).ceil().clamp(1.0, 200.0) as usize;
        // Each edge is computed from both ends, so that the last one equals the maximum exactly.
        let edge = |i: usize| lo + (hi - lo) * (i as f64 / bins as f64);
        let edges: Vec<f64> = (0..=bins).map(edge).collect();
        let mut counts = vec![0; bins];
        for x in ordered {
            counts[edges[1..bins].partition_point(|edge| *edge <= x)] += 1;
        }
        Self { edges, counts }
    }

    /// Density in each bin, normalised so that the areas sum to one.
    pub fn density(&self) -> Vec<f64> {
        let total = self.counts.iter().sum::<u64>() as f64;
        let widths = self.edges.windows(2).map(|pair| pair[1] - pair[0]);
        self.counts.iter().zip(widths).map(|(&n, width)| n as f64 / (total * width)).collect()
    }
}

/// Smooth density estimate of a sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DensityCurve {
    /// Positions at which the density is given.
    pub x: Vec<f64>,
    /// Density at each position.
    pub density: Vec<f64>,
}

impl DensityCurve {
    /// Gaussian kernel density estimate at `count` equally spaced positions.
    ///
    /// The bandwidth is Silverman's, `0.9 min(sd, IQR / 1.34) n^(-1/5)` (1986, eq. 3.31). At a finite bound of the
    /// support the sample is reflected, so that no mass is lost beyond it. The curve is empty for a sample without
    /// spread.
    pub fn of(values: &[f64], support: (f64, f64), count: usize) -> Self {
        let inside = |x: &f64| x.is_finite() && *x >= support.0 && *x <= support.1;
        let ordered = sorted(&values.iter().copied().filter(inside).collect::<Vec<_>>());
        let n = ordered.len() as f64;
        let sd = if ordered.len() > 1 { variance(&ordered).sqrt() } else { 0.0 };
        let quartiles = (quantile(&ordered, 0.75) - quantile(&ordered, 0.25)) / 1.34;
        let spread = if quartiles > 0.0 { sd.min(quartiles) } else { sd };
        let bandwidth = 0.9 * spread * n.powf(-0.2);
        if bandwidth.is_nan() || bandwidth <= 0.0 || count < 2 {
            return Self { x: Vec::new(), density: Vec::new() };
        }
        let lo = (ordered[0] - 3.0 * bandwidth).max(support.0);
        let hi = (ordered[ordered.len() - 1] + 3.0 * bandwidth).min(support.1);
        let x: Vec<f64> =
            (0..count).map(|i| lo + (hi - lo) * i as f64 / (count - 1) as f64).collect();
        let density = x.iter().map(|&x| {
            let direct = kernel_sum(&ordered, x, bandwidth);
            let mirrored: f64 = [support.0, support.1]
                .into_iter()
                .filter(|bound| bound.is_finite())
                .map(|bound| kernel_sum(&ordered, 2.0 * bound - x, bandwidth))
                .sum();
            (direct + mirrored) / (n * bandwidth)
        });
        let density = density.collect();
        Self { x, density }
    }
}

/// Sum of standard normal kernels at `x`; kernels further away than eight bandwidths are negligible and skipped.
fn kernel_sum(ordered: &[f64], x: f64, bandwidth: f64) -> f64 {
    let from = ordered.partition_point(|v| *v < x - 8.0 * bandwidth);
    let to = ordered.partition_point(|v| *v <= x + 8.0 * bandwidth);
    let root = (2.0 * std::f64::consts::PI).sqrt();
    ordered[from..to].iter().map(|v| (-0.5 * ((x - v) / bandwidth).powi(2)).exp() / root).sum()
}

/// Kolmogorov-Smirnov distance: the largest difference between the empirical distribution function of a sorted sample
/// and `cdf`.
pub fn kolmogorov_distance(sorted: &[f64], cdf: impl Fn(f64) -> f64) -> f64 {
    let n = sorted.len() as f64;
    sorted.iter().enumerate().fold(0.0, |worst: f64, (i, &x)| {
        let f = cdf(x);
        worst.max(f - i as f64 / n).max((i + 1) as f64 / n - f)
    })
}

/// Probability that `n` independent draws have a larger Kolmogorov-Smirnov distance from their distribution
/// (Kolmogorov's limit with Stephens' correction for small samples, 1970).
pub fn kolmogorov_probability(distance: f64, n: f64) -> f64 {
    let t = distance * (n.sqrt() + 0.12 + 0.11 / n.sqrt());
    if t < 1.0 {
        // Jacobi's identity of the theta function gives a series that converges where the alternating one does not.
        let factor = (2.0 * std::f64::consts::PI).sqrt() / t;
        let exponent = std::f64::consts::PI.powi(2) / (8.0 * t * t);
        let sum: f64 = (1..20).map(|k| (-exponent * f64::from(2 * k - 1).powi(2)).exp()).sum();
        return if t > 0.0 { (1.0 - factor * sum).clamp(0.0, 1.0) } else { 1.0 };
    }
    let term = |k: i32| {
        let sign = if k % 2 == 1 { 1.0 } else { -1.0 };
        sign * (-2.0 * t * t * f64::from(k * k)).exp()
    };
    (2.0 * (1..50).map(term).sum::<f64>()).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::distribution::Distribution;
    use crate::math::random::Stream;

    /// Readings of a clock that differ by milliseconds. The numbers are multiples of 2⁻¹⁰, so that their mean is exact.
    #[test]
    fn the_mean_of_large_numbers_keeps_their_differences() {
        let clock: Vec<f64> =
            (0..40_000).map(|i| 1.7e9 + f64::from(i % 5) / 1024.0 + f64::from(i % 2)).collect();
        assert_eq!(mean(&clock), 1.7e9 + 2.0 / 1024.0 + 0.5);
        // Of 0 to 4 in steps of 1/1024: a variance of 2; of 0 and 1: 1/4; and the two are independent.
        let expected = (2.0 / 1024.0_f64.powi(2) + 0.25) * 40_000.0 / 39_999.0;
        assert!((variance(&clock) / expected - 1.0).abs() < 1e-12, "{}", variance(&clock));
        assert_eq!(mean(&[f64::INFINITY, 1.0]), f64::INFINITY);
        assert!(mean(&[]).is_nan() && mean(&[f64::NAN, 1.0]).is_nan());
    }

    const SAMPLE: [f64; 12] = [0.9, 2.1, 0.3, 1.7, 5.2, 0.8, 1.1, 3.3, 2.4, 0.6, 1.5, 7.9];

    #[test]
    fn a_quantile_without_sorting_is_that_of_the_sorted_sample() {
        let mut rng = crate::math::random::Stream::root(9).generator();
        for count in [0, 1, 2, 7, 1000] {
            // Rounded, so that values are equal.
            let values: Vec<f64> = (0..count)
                .map(|_| (10.0 * crate::math::random::normal(&mut rng)).round())
                .collect();
            for p in [0.0, 0.025, 0.5, 0.975, 1.0] {
                let (expected, found) =
                    (quantile(&sorted(&values), p), quantile_of(&mut values.clone(), p));
                assert_eq!(found.to_bits(), expected.to_bits(), "{count} {p}");
            }
        }
    }

    #[test]
    fn quantiles_are_those_of_numpy() {
        // Source: numpy 2.4, np.quantile(x, p).
        let ordered = sorted(&SAMPLE);
        for (p, expected) in
            [(0.0, 0.3), (0.025, 0.3825), (0.25, 0.875), (0.5, 1.6), (0.9, 5.01), (1.0, 7.9)]
        {
            assert!((quantile(&ordered, p) - expected).abs() < 1e-14, "{p}");
        }
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn the_histogram_is_that_of_numpy() {
        // Source: numpy 2.4, np.histogram(x, 'fd').
        let histogram = Histogram::of(&SAMPLE);
        assert_eq!(histogram.counts, [7, 3, 0, 1, 1]);
        for (edge, expected) in histogram.edges.iter().zip([0.3, 1.82, 3.34, 4.86, 6.38, 7.9]) {
            assert!((edge - expected).abs() < 1e-12);
        }
        let area: f64 = histogram.density().iter().map(|d| d * 1.52).sum();
        assert!((area - 1.0).abs() < 1e-12);
        assert_eq!(Histogram::of(&[2.0, 2.0]).counts, [2]);
        assert!(Histogram::of(&[f64::NAN]).counts.is_empty());
    }

    #[test]
    fn running_moments_keep_their_digits_far_from_zero() {
        // The sample covariance does not change under a shift; source: numpy 2.4, np.var(x, ddof=1).
        let mut moments = Moments::new(2);
        for x in SAMPLE {
            moments.add(&[1e9 + x, -2.0 * x]);
        }
        assert!((moments.mean()[1] + 2.0 * 2.316_666_666_666_667).abs() < 1e-14);
        let variance = 4.941_515_151_515_151;
        let covariance = moments.covariance();
        assert!((covariance[(0, 0)] / variance - 1.0).abs() < 1e-6);
        assert!((covariance[(1, 1)] / (4.0 * variance) - 1.0).abs() < 1e-14);
        assert!((moments.correlation()[(0, 1)] + 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_density_curve_follows_the_law_up_to_its_bounds() {
        // A kernel estimate without reflection would give one half of the density at the bound.
        let law = Distribution::Exponential(1.0);
        let mut rng = Stream::root(3).generator();
        let draws: Vec<f64> = (0..20_000).map(|_| law.sample(&mut rng)).collect();
        let curve = DensityCurve::of(&draws, (0.0, f64::INFINITY), 256);
        for (x, density) in curve.x.iter().zip(&curve.density) {
            assert!((density - (-x).exp()).abs() < 0.08, "{x}: {density}");
        }
        let step = curve.x[1] - curve.x[0];
        let ends = curve.density[0] + curve.density[255];
        let area = step * (curve.density.iter().sum::<f64>() - 0.5 * ends);
        assert!((area - 1.0).abs() < 2e-3, "{area}");
        assert!(DensityCurve::of(&[1.0, 1.0], (0.0, 2.0), 10).x.is_empty());
    }

    #[test]
    fn kolmogorov_probabilities_are_those_of_scipy() {
        // Source: scipy 1.17, scipy.stats.kstwo.sf(d, n); Stephens' correction is good to about 0.005.
        for (distance, n, expected) in [
            (0.02, 1000.0, 0.810_897),
            (0.05, 1000.0, 0.013_012),
            (0.1, 100.0, 0.252_693),
            (0.2, 50.0, 0.031_439),
            (0.3, 20.0, 0.043_067),
        ] {
            let found = kolmogorov_probability(distance, n);
            assert!((found - expected).abs() < 5e-3, "{distance}, {n}: {found}");
        }
        assert_eq!(kolmogorov_probability(0.0, 10.0), 1.0);
    }
}
