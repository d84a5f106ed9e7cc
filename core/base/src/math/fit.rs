//! Selection of the named distribution that describes a sample best.

use serde::{Deserialize, Serialize};

use super::distribution::Distribution;
use super::moments::{kolmogorov_distance, kolmogorov_probability, mean, sorted, variance};
use super::special::{inverse_ln_minus_digamma, ln_one_plus_minus};

/// A distribution fitted to a sample by maximum likelihood.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// The fitted distribution.
    pub distribution: Distribution,
    /// Akaike's information criterion of the sample; smaller is better. Both parameters of the distribution count, and
    /// the log-likelihood is scaled from the number of draws to the effective sample size.
    pub aic: f64,
    /// Kolmogorov-Smirnov statistic: largest distance between the empirical and the fitted distribution function.
    pub distance: f64,
    /// p-value of the Kolmogorov-Smirnov statistic at the effective sample size. It is too large, because the
    /// parameters are estimated from the same sample.
    pub probability: f64,
}

/// Relative standard deviation (standard deviation over mean) below which distributions of positive numbers are
/// indistinguishable from the normal one: their log-likelihoods differ by about its square times the size of the
/// sample.
const NARROWEST: f64 = 1e-6;

/// Fits normal, log-normal and gamma distributions to a sample, best first by AIC.
///
/// `effective` is the effective sample size. Distributions of positive numbers are tried if all values are above zero
/// and the standard deviation exceeds a millionth of the mean: below that they cannot be told from the normal one.
/// Fewer than three finite values, or values that are all equal, give an empty list.
pub fn fit(values: &[f64], effective: f64) -> Vec<Fit> {
    let finite: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
    let ordered = sorted(&finite);
    let n = ordered.len() as f64;
    if ordered.len() < 3 || ordered[0] == ordered[ordered.len() - 1] {
        return Vec::new();
    }
    let biased_sd = |x: &[f64]| (variance(x) * (n - 1.0) / n).sqrt();
    let (centre, sd) = (mean(&ordered), biased_sd(&ordered));
    let mut laws = vec![Distribution::Normal([centre, sd])];
    if ordered[0] > 0.0 && sd > NARROWEST * centre {
        let logs: Vec<f64> = ordered.iter().map(|x| x.ln()).collect();
        laws.push(Distribution::LogNormal([mean(&logs), biased_sd(&logs)]));
        laws.extend(gamma(&ordered));
    }
    let effective = effective.clamp(1.0, n);
    let mut fits: Vec<Fit> = laws
        .into_iter()
        .filter(|law| law.check().is_ok())
        .map(|distribution| {
            let average = ordered.iter().map(|&x| distribution.log_density(x)).sum::<f64>() / n;
            let distance = kolmogorov_distance(&ordered, |x| distribution.cdf(x));
            let probability = kolmogorov_probability(distance, effective);
            Fit { distribution, aic: 4.0 - 2.0 * effective * average, distance, probability }
        })
        .collect();
    fits.sort_by(|a, b| a.aic.total_cmp(&b.aic));
    fits
}

/// Mean of the logarithms of positive numbers less the logarithm of their mean, without cancellation if their spread is
/// small compared with their mean.
fn log_of_mean_exceeds(values: &[f64], mean: f64) -> f64 {
    let n = values.len() as f64;
    let relative = |x: &f64| (x - mean) / mean;
    // Zero except for rounding of the mean.
    let offset = values.iter().map(relative).sum::<f64>() / n;
    let curved = values.iter().map(|x| ln_one_plus_minus(relative(x))).sum::<f64>() / n;
    ln_one_plus_minus(offset) - curved
}

/// Maximum likelihood estimate of the gamma distribution; `None` if the equation of its shape has no solution.
fn gamma(values: &[f64]) -> Option<Distribution> {
    let mean = mean(values);
    let gap = log_of_mean_exceeds(values, mean);
    let shape = (gap > 0.0 && gap.is_finite()).then(|| inverse_ln_minus_digamma(gap))?;
    Some(Distribution::Gamma([shape, mean / shape]))
}

#[cfg(test)]
mod tests {
    // Reference values keep the digits that the programs print.
    #![allow(clippy::unreadable_literal)]

    use super::*;
    use crate::math::random::Stream;
    use crate::math::special::normal_quantile;

    const SAMPLE: [f64; 12] = [0.9, 2.1, 0.3, 1.7, 5.2, 0.8, 1.1, 3.3, 2.4, 0.6, 1.5, 7.9];

    #[test]
    fn fits_are_those_of_scipy() {
        // Source: scipy 1.17, lognorm.fit and gamma.fit with floc=0, norm.fit, kstest.statistic;
        // aic = 4 - 2 sum(logpdf).
        let fits = fit(&SAMPLE, 12.0);
        let expected = [
            (
                "log_normal",
                [0.45957924829389724, 0.8862019539529683],
                46.184976787508866,
                0.07683140877992245,
            ),
            (
                "gamma",
                [1.4581266324866513, 1.5887966209874953],
                47.22831353335235,
                0.12401642952556102,
            ),
            ("normal", [2.316666666666667, 2.128315], 56.18245221311706, 0.23438355853831105),
        ];
        for (fit, (name, numbers, aic, distance)) in fits.iter().zip(expected) {
            assert_eq!(fit.distribution.name(), name);
            for (found, expected) in fit.distribution.numbers().iter().zip(numbers) {
                assert!((found / expected - 1.0).abs() < 1e-6, "{name}: {found}");
            }
            assert!((fit.aic - aic).abs() < 1e-9, "{name}: {}", fit.aic);
            assert!((fit.distance - distance).abs() < 1e-9, "{name}: {}", fit.distance);
        }
    }

    #[test]
    fn the_law_that_made_a_sample_is_found() {
        for (i, law) in [
            Distribution::Normal([5.0, 1.0]),
            Distribution::LogNormal([0.0, 0.7]),
            Distribution::Gamma([2.0, 3.0]),
        ]
        .into_iter()
        .enumerate()
        {
            let mut rng = Stream::root(9).at(i as u64).generator();
            let draws: Vec<f64> = (0..3000).map(|_| law.sample(&mut rng)).collect();
            let best = &fit(&draws, 3000.0)[0];
            assert_eq!(best.distribution.name(), law.name());
            assert!(best.probability > 0.05, "{law}: {}", best.probability);
        }
    }

    #[test]
    fn narrow_samples_are_fitted_at_once() {
        // A mean of 1e9 with a standard deviation of one, and narrower and wider samples.
        let z: Vec<f64> = (1..4000).map(|i| normal_quantile(f64::from(i) / 4000.0)).collect();
        for relative in [1e-15, 1e-12, 1e-9, 1e-7, 1e-5, 1e-4, 1e-3, 1e-2] {
            let values: Vec<f64> = z.iter().map(|z| 1e9 * (1.0 + relative * z)).collect();
            let begun = std::time::Instant::now();
            let fits = fit(&values, 4000.0);
            assert!(begun.elapsed().as_secs_f64() < 1.0, "{relative}: {:?}", begun.elapsed());
            // A law whose width is lost to rounding is none that a study could have.
            let count = if relative > NARROWEST { 3 } else { usize::from(relative > 1e-14) };
            assert_eq!(fits.len(), count, "{relative}");
            for law in fits.iter().map(|fit| &fit.distribution) {
                // The relative width is one over the square root of the shape.
                let width = law.sd() / law.mean() / relative;
                assert!((width - 1.0).abs() < 0.01, "{relative}: {law}");
                assert!((law.mean() / 1e9 - 1.0).abs() < 1e-3 * relative + 1e-15, "{law}");
            }
        }
    }

    #[test]
    fn a_sample_without_spread_fits_nothing() {
        assert!(fit(&[1.0; 10], 10.0).is_empty());
        assert_eq!(fit(&[-1.0, 2.0, 3.0, 4.0], 4.0).len(), 1);
    }
}
