//! The named law that describes a sample best.

use serde::{Deserialize, Serialize};
use statrs::function::gamma::digamma;

use super::distribution::Distribution;
use super::moments::{kolmogorov_distance, kolmogorov_probability, mean, sorted, variance};

/// A law fitted to a sample by maximum likelihood.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// The law.
    pub distribution: Distribution,
    /// Akaike's information criterion of the sample: smaller is better. Both numbers of the law
    /// count, and draws count as if they were independent, scaled to the effective sample size.
    pub aic: f64,
    /// The statistic of Kolmogorov and Smirnov, the largest distance between the distribution functions.
    pub distance: f64,
    /// The probability of a larger distance if the law were true, at the effective sample size.
    /// The law's numbers come from the same sample, so that it is larger than it ought to be.
    pub probability: f64,
}

/// The normal, log-normal and gamma laws fitted to a sample, best first by AIC.
///
/// `effective` is the number of independent draws the sample is worth. Laws of positive numbers
/// are tried when all values are above zero. Fewer than three finite values, or values that are all
/// equal, fit nothing.
pub fn fit(values: &[f64], effective: f64) -> Vec<Fit> {
    let finite: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
    let ordered = sorted(&finite);
    let n = ordered.len() as f64;
    if ordered.len() < 3 || ordered[0] == ordered[ordered.len() - 1] {
        return Vec::new();
    }
    let biased_sd = |x: &[f64]| (variance(x) * (n - 1.0) / n).sqrt();
    let mut laws = vec![Distribution::Normal([mean(&ordered), biased_sd(&ordered)])];
    if ordered[0] > 0.0 {
        let logs: Vec<f64> = ordered.iter().map(|x| x.ln()).collect();
        laws.push(Distribution::LogNormal([mean(&logs), biased_sd(&logs)]));
        laws.push(gamma(mean(&ordered), mean(&logs)));
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

/// The gamma law of largest likelihood, from the mean and the mean of the logarithms.
///
/// Newton's steps on the reciprocal of the shape (Minka, 2002).
fn gamma(mean: f64, mean_of_logs: f64) -> Distribution {
    let gap = mean.ln() - mean_of_logs;
    let mut shape = (3.0 - gap + ((gap - 3.0).powi(2) + 24.0 * gap).sqrt()) / (12.0 * gap);
    for _ in 0..50 {
        let step =
            (shape.ln() - digamma(shape) - gap) / (shape * shape * (1.0 / shape - trigamma(shape)));
        let next = 1.0 / (1.0 / shape + step);
        let done = (next - shape).abs() <= 1e-13 * shape;
        shape = next;
        if done {
            break;
        }
    }
    Distribution::Gamma([shape, mean / shape])
}

/// The derivative of the digamma function: recurrence, then the asymptotic series
/// (Abramowitz and Stegun 6.4.6 and 6.4.12).
fn trigamma(x: f64) -> f64 {
    let (mut x, mut sum) = (x, 0.0);
    while x < 12.0 {
        sum += 1.0 / (x * x);
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    let series = y * (1.0 / 6.0 - y * (1.0 / 30.0 - y * (1.0 / 42.0 - y / 30.0)));
    sum + (1.0 + 0.5 / x + series) / x
}

#[cfg(test)]
mod tests {
    // Tables keep the digits as the programs print them.
    #![allow(clippy::unreadable_literal)]

    use super::*;
    use crate::math::random::Stream;

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
    fn a_sample_without_spread_fits_nothing() {
        assert!(fit(&[1.0; 10], 10.0).is_empty());
        assert_eq!(fit(&[-1.0, 2.0, 3.0, 4.0], 4.0).len(), 1);
    }
}
