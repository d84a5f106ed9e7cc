//! Curves computed from draws: histograms, kernel densities, and densities of named distributions.

use lacuna::math::distribution::Distribution;
use lacuna::math::moments::variance;

/// Histogram with bins of equal width, normalised to area one.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Left edge of the first bin.
    pub start: f64,
    /// Width of a bin.
    pub width: f64,
    /// Density in each bin: the count divided by (number of values times width).
    pub density: Vec<f64>,
}

impl Histogram {
    /// Histogram of the finite `values`.
    ///
    /// The bin width is 2 IQR n^(-1/3) (Freedman and Diaconis 1981), with at most `most` bins; values that are all
    /// equal share one bin.
    pub fn of(values: &[f64], most: usize) -> Option<Self> {
        let sorted = sorted(values);
        let (low, high) = (*sorted.first()?, *sorted.last()?);
        let n = sorted.len() as f64;
        let span = high - low;
        if !span.is_finite() || span <= 1e-12 * high.abs().max(low.abs()) {
            let width = if high == 0.0 { 1.0 } else { 0.01 * high.abs() };
            return Some(Self { start: low - 0.5 * width, width, density: vec![1.0 / width] });
        }
        let ideal = 2.0 * (quantile(&sorted, 0.75) - quantile(&sorted, 0.25)) / n.cbrt();
        let bins = if ideal > 0.0 { (span / ideal).ceil() } else { n.sqrt().ceil() };
        let bins = (bins as usize).clamp(1, most.max(1));
        let width = span / bins as f64;
        let mut density = vec![0.0; bins];
        for v in &sorted {
            let bin = (((v - low) / width) as usize).min(bins - 1);
            density[bin] += 1.0 / (n * width);
        }
        Some(Self { start: low, width, density })
    }

    /// Left edge, right edge and density of each bin.
    pub fn bins(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        self.density.iter().enumerate().map(|(i, &density)| {
            let left = self.start + i as f64 * self.width;
            (left, left + self.width, density)
        })
    }
}

/// Kernel density estimate of the finite `values`: a Gaussian kernel on a grid of `count` points.
///
/// The bandwidth is 0.9 min(sd, IQR / 1.34) n^(-1/5) (Silverman 1986, equation 3.31), where n is the effective sample
/// size if it is smaller than the number of values. The values are binned onto the grid first, so that the cost of the
/// convolution does not grow with their number. Empty if all values are equal.
pub fn smooth_density(values: &[f64], effective: f64, count: usize) -> Vec<(f64, f64)> {
    let sorted = sorted(values);
    let n = sorted.len() as f64;
    let spread = spread(&sorted);
    let effective = if effective >= 1.0 { effective.min(n) } else { n };
    let bandwidth = 0.9 * spread * effective.powf(-0.2);
    let (Some(&low), Some(&high)) = (sorted.first(), sorted.last()) else { return Vec::new() };
    if count < 2 || !bandwidth.is_finite() || bandwidth <= 1e-12 * low.abs().max(high.abs()) {
        return Vec::new();
    }
    let (start, end) = (low - 3.0 * bandwidth, high + 3.0 * bandwidth);
    let step = (end - start) / (count - 1) as f64;
    let mut weight = vec![0.0; count];
    for v in &sorted {
        let place = (v - start) / step;
        let left = (place as usize).min(count - 2);
        let share = place - left as f64;
        weight[left] += (1.0 - share) / n;
        weight[left + 1] += share / n;
    }
    let reach = ((4.0 * bandwidth / step).ceil() as usize).max(1);
    let kernel: Vec<f64> = (0..=reach)
        .map(|k| {
            let z = k as f64 * step / bandwidth;
            (-0.5 * z * z).exp() / (bandwidth * (2.0 * std::f64::consts::PI).sqrt())
        })
        .collect();
    (0..count)
        .map(|i| {
            let near = i.saturating_sub(reach)..(i + reach + 1).min(count);
            let density = near.map(|j| weight[j] * kernel[i.abs_diff(j)]).sum();
            (start + i as f64 * step, density)
        })
        .collect()
}

/// Density of a named distribution at `count` points of an interval.
pub fn named_density(
    distribution: &Distribution,
    (low, high): (f64, f64),
    count: usize,
) -> Vec<(f64, f64)> {
    let step = (high - low) / (count.max(2) - 1) as f64;
    (0..count)
        .map(|i| low + i as f64 * step)
        .map(|x| (x, distribution.log_density(x).exp()))
        .filter(|(_, density)| density.is_finite())
        .collect()
}

/// The finite `values` in ascending order.
pub fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

/// Quantile of sorted values by linear interpolation (type 7 of Hyndman and Fan 1996).
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share.clamp(0.0, 1.0) * last as f64;
    let left = place.floor() as usize;
    let right = (left + 1).min(last);
    sorted[left] + (place - left as f64) * (sorted[right] - sorted[left])
}

/// The smaller of the standard deviation and IQR / 1.34, which equals it for a normal distribution.
fn spread(sorted: &[f64]) -> f64 {
    let sd = variance(sorted).sqrt();
    let iqr = (quantile(sorted, 0.75) - quantile(sorted, 0.25)) / 1.34;
    if iqr > 0.0 { sd.min(iqr) } else { sd }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna::math::random::{Stream, normal};

    fn normals(n: usize) -> Vec<f64> {
        let mut rng = Stream::root(5).generator();
        (0..n).map(|_| normal(&mut rng)).collect()
    }

    #[test]
    fn a_histogram_has_area_one() {
        for values in [normals(5000), vec![3.0; 40], vec![0.0], vec![1e300, -1e300, 0.0, 2.0]] {
            let histogram = Histogram::of(&values, 60).unwrap();
            let area: f64 = histogram.bins().map(|(left, right, d)| (right - left) * d).sum();
            assert!((area - 1.0).abs() < 1e-9, "{area}");
        }
        assert_eq!(Histogram::of(&[f64::NAN], 60), None);
    }

    /// The expectation of the kernel estimate at x is the normal density with variance 1 + h^2, and
    /// its standard error is below sqrt(f(x) / (2 sqrt(pi) n h)) (Silverman 1986, section 3.3).
    #[test]
    fn the_smooth_density_of_normal_numbers_is_normal() {
        let n = 20_000.0_f64;
        let curve = smooth_density(&normals(20_000), f64::NAN, 512);
        let h = 0.9 * n.powf(-0.2);
        for &(x, density) in curve.iter().filter(|(x, _)| x.abs() < 2.0) {
            let v = 1.0 + h * h;
            let expected = (-0.5 * x * x / v).exp() / (2.0 * std::f64::consts::PI * v).sqrt();
            let error = (expected / (2.0 * std::f64::consts::PI.sqrt() * n * h)).sqrt();
            assert!((density - expected).abs() < 4.5 * error + 2e-3, "{x}: {density} {expected}");
        }
        let step = curve[1].0 - curve[0].0;
        let mass: f64 = curve.iter().map(|(_, d)| d * step).sum();
        assert!((mass - 1.0).abs() < 1e-3);
    }

    #[test]
    fn equal_values_have_no_smooth_density() {
        assert!(smooth_density(&[2.0; 50], 50.0, 100).is_empty());
        assert!(smooth_density(&[2.0], 1.0, 100).is_empty());
        assert!(smooth_density(&[], 0.0, 100).is_empty());
    }

    /// Hyndman and Fan (1996), type 7: the quantiles of 1, 2, 3, 4 are 1 + 3 p.
    #[test]
    fn quantiles_are_interpolated() {
        assert_eq!(quantile(&[1.0, 2.0, 3.0, 4.0], 0.25), 1.75);
        assert!(quantile(&[], 0.5).is_nan());
    }
}
