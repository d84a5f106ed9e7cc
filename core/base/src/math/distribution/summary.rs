//! Support, mean, variance and mode.

use std::f64::consts::FRAC_2_PI;

use super::Distribution;
use super::probability::ln_ratio;
use super::quantiles::Quantiles;
use crate::math::special::{five_point_rule, ln_gamma_half_step};

impl Distribution {
    /// Closed interval outside which the density is zero; infinite where it is unbounded.
    pub fn support(&self) -> (f64, f64) {
        match *self {
            Self::Uniform([lo, hi])
            | Self::LogUniform([lo, hi])
            | Self::Beta([_, _, lo, hi])
            | Self::TruncatedNormal([_, _, lo, hi])
            | Self::Triangular([lo, _, hi]) => (lo, hi),
            Self::Quantiles(ref n) => Quantiles::of(n).support(),
            Self::Normal(_) | Self::StudentT(_) => (f64::NEG_INFINITY, f64::INFINITY),
            Self::HalfNormal(_)
            | Self::LogNormal(_)
            | Self::Gamma(_)
            | Self::InverseGamma(_)
            | Self::Exponential(_)
            | Self::HalfStudentT(_) => (0.0, f64::INFINITY),
        }
    }

    /// Mean; infinite or NaN if it does not exist (an inverse gamma distribution of shape one or less, Student's t with
    /// one degree of freedom or less, also of its size).
    pub fn mean(&self) -> f64 {
        match *self {
            Self::Quantiles(ref n) => Quantiles::of(n).mean(),
            Self::Uniform([lo, hi]) => lo + 0.5 * (hi - lo),
            Self::Normal([mean, _]) | Self::Exponential(mean) => mean,
            Self::HalfNormal(scale) => scale * FRAC_2_PI.sqrt(),
            Self::LogNormal([mu, sigma]) => (mu + 0.5 * sigma * sigma).exp(),
            Self::LogUniform([lo, hi]) => (hi - lo) / ln_ratio(lo, hi),
            Self::Gamma([shape, scale]) => shape * scale,
            Self::InverseGamma([shape, scale]) if shape > 1.0 => scale / (shape - 1.0),
            Self::Beta([a, b, lo, hi]) => lo + (hi - lo) * a / (a + b),
            Self::StudentT([dof, location, _]) if dof > 1.0 => location,
            Self::StudentT(_) => f64::NAN,
            Self::HalfStudentT([dof, scale]) if dof > 1.0 => scale * mean_size_of_student(dof),
            Self::InverseGamma(_) | Self::HalfStudentT(_) => f64::INFINITY,
            Self::TruncatedNormal([mean, sd, lo, hi]) => {
                mean + sd * truncated_moments((lo - mean) / sd, (hi - mean) / sd).0
            }
            Self::Triangular([lo, mode, hi]) => (lo + mode + hi) / 3.0,
        }
    }

    /// Variance; infinite or NaN if it does not exist.
    pub fn variance(&self) -> f64 {
        match *self {
            Self::Quantiles(ref n) => Quantiles::of(n).variance(),
            Self::Uniform([lo, hi]) => (hi - lo).powi(2) / 12.0,
            Self::Normal([_, sd]) => sd * sd,
            Self::HalfNormal(scale) => scale * scale * (1.0 - FRAC_2_PI),
            Self::LogNormal([mu, sigma]) => {
                (sigma * sigma).exp_m1() * (2.0 * mu + sigma * sigma).exp()
            }
            Self::LogUniform([lo, hi]) => {
                let mean = (hi - lo) / ln_ratio(lo, hi);
                mean * (0.5 * (hi + lo) - mean)
            }
            Self::Gamma([shape, scale]) => shape * scale * scale,
            Self::InverseGamma([shape, scale]) if shape > 2.0 => {
                (scale / (shape - 1.0)).powi(2) / (shape - 2.0)
            }
            Self::Beta([a, b, lo, hi]) => {
                (hi - lo).powi(2) * a * b / ((a + b).powi(2) * (a + b + 1.0))
            }
            Self::Exponential(mean) => mean * mean,
            Self::StudentT([dof, _, scale]) if dof > 2.0 => scale * scale * dof / (dof - 2.0),
            Self::StudentT([dof, _, _]) if dof > 1.0 => f64::INFINITY,
            Self::StudentT(_) => f64::NAN,
            Self::HalfStudentT([dof, scale]) if dof > 2.0 => {
                scale * scale * (dof / (dof - 2.0) - mean_size_of_student(dof).powi(2))
            }
            Self::InverseGamma(_) | Self::HalfStudentT(_) => f64::INFINITY,
            Self::TruncatedNormal([mean, sd, lo, hi]) => {
                sd * sd * truncated_moments((lo - mean) / sd, (hi - mean) / sd).1
            }
            Self::Triangular([lo, mode, hi]) => {
                (lo * (lo - mode) + mode * (mode - hi) + hi * (hi - lo)) / 18.0
            }
        }
    }

    /// Standard deviation.
    pub fn sd(&self) -> f64 {
        self.variance().sqrt()
    }

    /// Mode: the middle if the density is flat, the lower bound if it diverges at both.
    pub fn mode(&self) -> f64 {
        match *self {
            Self::Quantiles(ref n) => Quantiles::of(n).mode(),
            Self::Uniform([lo, hi]) | Self::Beta([1.0, 1.0, lo, hi]) => lo + 0.5 * (hi - lo),
            Self::Normal([mode, _])
            | Self::StudentT([_, mode, _])
            | Self::Triangular([_, mode, _]) => mode,
            Self::HalfNormal(_) | Self::Exponential(_) | Self::HalfStudentT(_) => 0.0,
            Self::LogNormal([mu, sigma]) => (mu - sigma * sigma).exp(),
            Self::LogUniform([lo, _]) => lo,
            Self::Gamma([shape, scale]) => (shape - 1.0).max(0.0) * scale,
            Self::InverseGamma([shape, scale]) => scale / (shape + 1.0),
            Self::Beta([a, b, lo, hi]) if a > 1.0 && b > 1.0 => {
                lo + (hi - lo) * (a - 1.0) / (a + b - 2.0)
            }
            Self::Beta([a, b, lo, hi]) => {
                if a <= b {
                    lo
                } else {
                    hi
                }
            }
            Self::TruncatedNormal([mean, _, lo, hi]) => mean.clamp(lo, hi),
        }
    }
}

/// Mean of the size of a variable with Student's t distribution: `2 sqrt(nu / pi) Gamma((nu + 1) / 2) / (Gamma(nu / 2) (nu - 1))`.
fn mean_size_of_student(dof: f64) -> f64 {
    2.0 * (dof / std::f64::consts::PI).sqrt() * ln_gamma_half_step(0.5 * dof).exp() / (dof - 1.0)
}

/// Mean and variance of a standard normal variable truncated to `a` and `b`.
///
/// By quadrature around the mode: the closed form loses all digits in a far tail or on a narrow interval.
fn truncated_moments(a: f64, b: f64) -> (f64, f64) {
    const PANELS: u32 = 64;
    let mode = 0.0_f64.clamp(a, b);
    // Beyond this distance the density is below e^-80 of its maximum.
    let reach = (mode * mode + 160.0).sqrt();
    let (lo, hi) = (a.max(-reach), b.min(reach));
    let width = (hi - lo) / f64::from(PANELS);
    let mut sums = [0.0; 3];
    for panel in 0..PANELS {
        for (node, weight) in five_point_rule() {
            let x = lo + width * (f64::from(panel) + 0.5 * (1.0 + node)) - mode;
            let density = weight * (-x * (0.5 * x + mode)).exp();
            sums[0] += density;
            sums[1] += density * x;
            sums[2] += density * x * x;
        }
    }
    let (first, second) = (sums[1] / sums[0], sums[2] / sums[0]);
    (mode + first, second - first * first)
}

/// Mean of a function of a standard normal variable, by quadrature on the central ±9.
pub(super) fn over_scores(value: impl Fn(f64) -> f64) -> f64 {
    const PANELS: u32 = 180;
    let (low, width) = (-9.0, 18.0 / f64::from(PANELS));
    let (mut sum, mut weights) = (0.0, 0.0);
    for panel in 0..PANELS {
        for (node, weight) in five_point_rule() {
            let z: f64 = low + width * (f64::from(panel) + 0.5 * (1.0 + node));
            let weight = weight * (-0.5 * z * z).exp();
            sum += weight * value(z);
            weights += weight;
        }
    }
    sum / weights
}
