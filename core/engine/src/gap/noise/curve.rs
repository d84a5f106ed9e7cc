//! The noise of one curve, from the differences between its replicates.

use serde::{Deserialize, Serialize};

use super::autoregression::Autoregression;
use super::expectation::Expectation;
use super::square::{Factor, square};
use super::succession::Succession;
use crate::gap::experiment::MeasuredCurve;

/// The highest order of autoregression that is tried.
const MOST: usize = 3;

/// Random effects of whole replicates, beside their noise: variances of an offset, a gain and a shift.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ReplicateVariation {
    /// The variance of an offset, in the response's unit squared.
    pub offset: f64,
    /// The variance of a gain.
    pub gain: f64,
    /// The variance of a shift along the last axis, in its unit squared.
    pub clock: f64,
}

impl ReplicateVariation {
    /// The variances in the order of [`directions`].
    pub fn variances(&self) -> [f64; 3] {
        [self.offset, self.gain, self.clock]
    }

    pub(super) fn of([offset, gain, clock]: [f64; 3]) -> Self {
        Self { offset, gain, clock }
    }
}

/// Noise of one curve: the variation of its replicates around their common mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurveNoise {
    /// The standard deviation of the innovations at the mean variance, in the response's unit.
    pub sd: f64,
    /// The autoregression of the noise.
    pub memory: Autoregression,
    /// The slope of the variance against the squared response divided by its mean square; zero for a constant variance.
    pub level: f64,
    /// The random effects of whole replicates.
    pub wander: ReplicateVariation,
    /// The standard deviation of the noise at each measured value relative to `sd`.
    pub profile: Vec<f64>,
}

impl CurveNoise {
    /// The autoregression at the measured values of a curve.
    pub fn succession(&self, curve: &MeasuredCurve) -> Succession {
        self.memory.on(&curve.places())
    }
}

/// The differences between replicates of a curve, with the shapes of the random effects.
pub struct Differences {
    /// Independent differences of the covariance of one replicate, one a row: Helmert's contrasts.
    pub(super) contrasts: Vec<Vec<f64>>,
    /// The directions of [`ReplicateVariation`].
    pub(super) directions: [Vec<f64>; 3],
    /// The response that the curve should show.
    pub(super) response: Vec<f64>,
}

/// The derivatives of a response (one value a measured output) by an offset, a gain and a shift along the axis: one,
/// the response, and its negative slope.
pub fn directions(response: &[f64], at: &[f64]) -> [Vec<f64>; 3] {
    let last = response.len().saturating_sub(1);
    let slope = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
        if a == b { 0.0 } else { -(response[b] - response[a]) / (at[b] - at[a]) }
    };
    [vec![1.0; response.len()], response.to_vec(), (0..response.len()).map(slope).collect()]
}

impl Differences {
    /// The differences of complete replicates, `replicates x values`, in the response's unit.
    pub fn new(replicates: &[Vec<f64>], response: &[f64], at: &[f64]) -> Self {
        let mut sum = vec![0.0; response.len()];
        let mut contrasts = Vec::new();
        for (k, replicate) in replicates.iter().enumerate() {
            if k > 0 {
                let k = k as f64;
                let each = sum.iter().zip(replicate);
                contrasts.push(each.map(|(s, y)| (s - k * y) / (k * (k + 1.0)).sqrt()).collect());
            }
            sum.iter_mut().zip(replicate).for_each(|(s, y)| *s += y);
        }
        Self { contrasts, directions: directions(response, at), response: response.to_vec() }
    }

    /// The maximum likelihood estimate of the noise with the order chosen by the corrected Akaike criterion (Hurvich
    /// and Tsai, Biometrika 76 (1989) 297), or with a given order. `None` without any difference.
    pub fn noise(&self, order: Option<usize>) -> Option<CurveNoise> {
        let total: f64 = self.contrasts.iter().flatten().map(|x| x * x).sum();
        if total <= 0.0 {
            return None;
        }
        let length = self.response.len();
        let most = MOST.min(length.saturating_sub(2) / 4);
        let orders = order.map_or(0..=most, |order| order.min(most)..=order.min(most));
        let mut best: Option<(f64, Expectation<'_>)> = None;
        for order in orders {
            let fit = Expectation::new(self, order).run();
            let criterion = fit.criterion();
            if best.as_ref().is_none_or(|(least, _)| criterion < *least) {
                best = Some((criterion, fit));
            }
        }
        best.map(|(_, fit)| fit.noise())
    }

    /// The number of independent differences.
    pub fn count(&self) -> usize {
        self.contrasts.len()
    }

    /// The innovations of all differences, concatenated.
    pub fn innovations(&self, noise: &CurveNoise) -> Vec<f64> {
        Expectation::of(self, noise).innovations().concat()
    }

    /// The coefficients of each difference on the three random effects, by least squares weighted with the noise.
    pub fn coefficients(&self, noise: &CurveNoise) -> Vec<[f64; 3]> {
        let fit = Expectation::of(self, noise);
        let normal = square(|i, j| {
            fit.gram[i][j] * if i == j { 1.0 + 1e-9 } else { 1.0 }
                + if i == j { f64::MIN_POSITIVE } else { 0.0 }
        });
        let Some(factor) = Factor::new(&normal) else {
            return vec![[0.0; 3]; self.contrasts.len()];
        };
        fit.whitened.iter().map(|c| factor.solve(fit.onto(c))).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna::math::random::{Stream, normal};

    /// Replicates made with known noise: autoregression 0.5 with innovations of sd 1, offsets of sd 2, gains of sd 0.1.
    fn replicates(count: usize, length: usize) -> (Vec<Vec<f64>>, Vec<f64>, Vec<f64>) {
        let at: Vec<f64> = (0..length).map(|t| t as f64).collect();
        let response: Vec<f64> = at.iter().map(|t| 20.0 * (0.2 * t).sin()).collect();
        let memory = Autoregression::of_autocovariances(&[1.0, 0.5], 1).0;
        let replicate = |r: usize| {
            let mut rng = Stream::root(11).at(r as u64).generator();
            let (offset, gain) = (2.0 * normal(&mut rng), 1.0 + 0.1 * normal(&mut rng));
            let mut noise: Vec<f64> = (0..length).map(|_| normal(&mut rng)).collect();
            memory.colour(&mut noise);
            response.iter().zip(noise).map(|(y, e)| gain * y + offset + e).collect()
        };
        ((0..count).map(replicate).collect(), response, at)
    }

    /// Standard errors: of a variance from n normal numbers `sqrt(2 / n)` of itself; of an
    /// autoregression's coefficient `sqrt((1 - a^2) / N)` (Brockwell and Davis, section 8.1).
    #[test]
    fn known_noise_is_found() {
        let (count, length) = (200, 80);
        let (replicates, response, at) = replicates(count, length);
        let differences = Differences::new(&replicates, &response, &at);
        // The criterion of Akaike takes an order too high in one case of six.
        assert!((1..=2).contains(&differences.noise(None).unwrap().memory.order()));
        let noise = differences.noise(Some(1)).unwrap();
        let (n, total) = (count as f64 - 1.0, (count as f64 - 1.0) * length as f64);
        let a = noise.memory.coefficients()[0];
        assert!((a - 0.5).abs() < 4.0 * (0.75 / total).sqrt(), "{a}");
        assert!((noise.sd.powi(2) - 1.0).abs() < 4.0 * (2.0 / total).sqrt(), "{}", noise.sd);
        assert!((noise.wander.offset / 4.0 - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{noise:?}");
        assert!((noise.wander.gain / 0.01 - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{noise:?}");
        // A shift of sd s moves the curve by about 2.8 s; what is found is far below the noise.
        assert!(noise.wander.clock.sqrt() * 2.8 < 0.1, "{noise:?}");
        assert!(noise.level.abs() < f64::MIN_POSITIVE);
    }

    #[test]
    fn a_variance_that_grows_with_the_response_is_found() {
        let length = 100;
        let at: Vec<f64> = (0..length).map(f64::from).collect();
        let response: Vec<f64> = at.iter().map(|t| 0.1 * t).collect();
        let replicate = |r: u64| {
            let mut rng = Stream::root(12).at(r).generator();
            response.iter().map(|y| y + (1.0 + 0.2 * y * y).sqrt() * normal(&mut rng)).collect()
        };
        let replicates: Vec<Vec<f64>> = (0..40).map(replicate).collect();
        let noise = Differences::new(&replicates, &response, &at).noise(None).unwrap();
        let square = response.iter().map(|y| y * y).sum::<f64>() / f64::from(length);
        // 0.2 m^2 = level m^2 / mean: level = 0.2 mean; the error of the slope is sqrt(2 / (n spread)).
        let expected = 0.2 * square;
        let (found, truth) = (noise.level / (1.0 + noise.level), expected / (1.0 + expected));
        assert!((found - truth).abs() < 0.1, "{found} {truth}");
    }
}
