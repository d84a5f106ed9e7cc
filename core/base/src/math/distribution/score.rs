//! Normal scores: values expressed as standard normal variables of the same probability.

use super::Distribution;
use super::probability::ln_ratio;
use super::quantiles::Quantiles;
use crate::math::special::{
    HALF_LN_TWO_PI, ln_normal_cdf, normal_cdf, normal_quantile, normal_quantile_of_ln,
};

/// Largest size of a score. Probabilities beyond it are below the smallest positive number.
const LARGEST: f64 = 37.0;

impl Distribution {
    /// Normal score of `x`: the standard normal value with the same probability below it. At the bounds of the support and
    /// beyond it is cut at 37 in size; without cancellation in the upper tail of the laws whose survival function is known
    /// (normal, log-normal, uniform, log-uniform, half-normal, exponential), to size 8 for all others.
    pub fn score(&self, x: f64) -> f64 {
        let z = match *self {
            Self::Normal([mean, sd]) => (x - mean) / sd,
            Self::LogNormal([mu, sigma]) if x > 0.0 => (x.ln() - mu) / sigma,
            Self::Quantiles(ref n) if x > n[0] && x < n[1] => Quantiles::of(n).score(x),
            _ => {
                let below = self.cdf(x);
                if below <= 0.5 {
                    normal_quantile(below)
                } else {
                    -normal_quantile_of_ln(self.ln_survival(x, below))
                }
            }
        };
        z.clamp(-LARGEST, LARGEST)
    }

    /// The value whose normal score is `z`: the inverse of [`Self::score`].
    pub fn at_score(&self, z: f64) -> f64 {
        match *self {
            Self::Normal([mean, sd]) => mean + sd * z,
            Self::LogNormal([mu, sigma]) => (mu + sigma * z).exp(),
            Self::StudentT([dof, location, scale]) if z > 0.0 => {
                location - Self::StudentT([dof, 0.0, scale]).at_score(-z)
            }
            Self::Quantiles(ref n) => Quantiles::of(n).at_score(z),
            _ => self.quantile(normal_cdf(z)),
        }
    }

    /// Derivative of the score by `x`, where the score is `z`.
    pub fn score_slope(&self, x: f64, z: f64) -> f64 {
        match *self {
            Self::Normal([_, sd]) => 1.0 / sd,
            Self::LogNormal([_, sigma]) => 1.0 / (sigma * x),
            _ if z.abs() >= LARGEST => 0.0,
            _ => (self.log_density(x) + 0.5 * z * z + HALF_LN_TWO_PI).exp(),
        }
    }

    /// Logarithm of the probability above `x`, of which the probability below is known.
    fn ln_survival(&self, x: f64, below: f64) -> f64 {
        match *self {
            Self::Uniform([lo, hi]) => ((hi - x) / (hi - lo)).max(0.0).ln(),
            Self::LogUniform([lo, hi]) if x < hi => (ln_ratio(x, hi) / ln_ratio(lo, hi)).ln(),
            Self::HalfNormal(scale) => std::f64::consts::LN_2 + ln_normal_cdf(-x / scale),
            Self::Exponential(mean) => -x / mean,
            _ => (-below).ln_1p(),
        }
    }
}
