//! Densities and their derivatives.

use super::Distribution;
use super::probability::{LARGE_FREEDOM, ln_ratio};
use super::quantiles::Quantiles;
use crate::math::special::{
    HALF_LN_TWO_PI, ln_beta_density, ln_gamma_density, ln_gamma_half_step, ln_normal_between,
};

fn ln_standard_normal(z: f64) -> f64 {
    -0.5 * z * z - HALF_LN_TWO_PI
}

fn ln_student(dof: f64, z: f64) -> f64 {
    if dof > LARGE_FREEDOM {
        // The gamma functions of the constant leave `1 / (4 dof)`.
        return -HALF_LN_TWO_PI - 0.25 / dof - 0.5 * (dof + 1.0) * (z * z / dof).ln_1p();
    }
    ln_gamma_half_step(0.5 * dof)
        - 0.5 * (dof * std::f64::consts::PI).ln()
        - 0.5 * (dof + 1.0) * (z * z / dof).ln_1p()
}

impl Distribution {
    /// Logarithm of the density at `x`, per unit of `x`; minus infinity outside the support.
    ///
    /// It is minus infinity also at a bound where the density diverges (a gamma distribution of shape below one at
    /// zero), because a single point must not capture a sampler.
    pub fn log_density(&self, x: f64) -> f64 {
        let (lo, hi) = self.support();
        if !(lo..=hi).contains(&x) || x.is_infinite() {
            return f64::NEG_INFINITY;
        }
        let value = match *self {
            Self::Uniform([lo, hi]) => -(hi - lo).ln(),
            Self::Normal([mean, sd]) => ln_standard_normal((x - mean) / sd) - sd.ln(),
            Self::HalfNormal(scale) => {
                ln_standard_normal(x / scale) - scale.ln() + std::f64::consts::LN_2
            }
            Self::LogNormal(_) | Self::InverseGamma(_) if x == 0.0 => f64::NEG_INFINITY,
            Self::LogNormal([mu, sigma]) => {
                ln_standard_normal((x.ln() - mu) / sigma) - sigma.ln() - x.ln()
            }
            Self::LogUniform([lo, hi]) => -x.ln() - ln_ratio(lo, hi).ln(),
            Self::Gamma([1.0, scale]) | Self::Exponential(scale) => -x / scale - scale.ln(),
            Self::Gamma(_) if x == 0.0 => f64::NEG_INFINITY,
            Self::Gamma([shape, scale]) => ln_gamma_density(shape, x / scale) - scale.ln(),
            Self::InverseGamma([shape, scale]) => {
                ln_gamma_density(shape, scale / x) + scale.ln() - 2.0 * x.ln()
            }
            Self::Beta([a, b, lo, hi]) => log_density_of_beta([a, b, lo, hi], x),
            Self::StudentT([dof, location, scale]) => {
                ln_student(dof, (x - location) / scale) - scale.ln()
            }
            Self::HalfStudentT([dof, scale]) => {
                ln_student(dof, x / scale) - scale.ln() + std::f64::consts::LN_2
            }
            Self::TruncatedNormal([mean, sd, lo, hi]) => {
                ln_standard_normal((x - mean) / sd)
                    - sd.ln()
                    - ln_normal_between((lo - mean) / sd, (hi - mean) / sd)
            }
            Self::Quantiles(ref n) if x > n[0] && x < n[1] => Quantiles::of(n).log_density(x),
            Self::Quantiles(_) => f64::NEG_INFINITY,
            Self::Triangular([lo, mode, hi]) => {
                let height = 2.0 / (hi - lo);
                let part = if x < mode {
                    (x - lo) / (mode - lo)
                } else if x > mode {
                    (hi - x) / (hi - mode)
                } else {
                    1.0
                };
                (height * part).ln()
            }
        };
        if value == f64::INFINITY || value.is_nan() { f64::NEG_INFINITY } else { value }
    }

    /// Derivative of [`Self::log_density`] by `x`; zero where the density is zero.
    pub fn log_density_derivative(&self, x: f64) -> f64 {
        if self.log_density(x) == f64::NEG_INFINITY {
            return 0.0;
        }
        match *self {
            Self::Uniform(_) => 0.0,
            Self::Normal([mean, sd]) | Self::TruncatedNormal([mean, sd, _, _]) => {
                -(x - mean) / (sd * sd)
            }
            Self::HalfNormal(scale) => -x / (scale * scale),
            Self::LogNormal([mu, sigma]) => -(1.0 + (x.ln() - mu) / (sigma * sigma)) / x,
            Self::LogUniform(_) => -1.0 / x,
            Self::Gamma([1.0, scale]) | Self::Exponential(scale) => -1.0 / scale,
            Self::Gamma([shape, scale]) => (shape - 1.0) / x - 1.0 / scale,
            Self::InverseGamma([shape, scale]) => (scale / x - shape - 1.0) / x,
            Self::Beta([a, b, lo, hi]) => {
                let left = if a == 1.0 { 0.0 } else { (a - 1.0) / (x - lo) };
                let right = if b == 1.0 { 0.0 } else { (b - 1.0) / (hi - x) };
                left - right
            }
            Self::StudentT([dof, location, scale]) => {
                let z = (x - location) / scale;
                -(dof + 1.0) * z / (dof + z * z) / scale
            }
            Self::HalfStudentT([dof, scale]) => {
                let z = x / scale;
                -(dof + 1.0) * z / (dof + z * z) / scale
            }
            Self::Quantiles(ref n) => Quantiles::of(n).log_density_derivative(x),
            Self::Triangular([lo, mode, hi]) => {
                if x < mode {
                    1.0 / (x - lo)
                } else if x > mode {
                    -1.0 / (hi - x)
                } else {
                    0.0
                }
            }
        }
    }
}

fn log_density_of_beta([a, b, lo, hi]: [f64; 4], x: f64) -> f64 {
    let width = hi - lo;
    let (left, right) = ((x - lo) / width, (hi - x) / width);
    if left > 0.0 && right > 0.0 {
        return ln_beta_density(a, b, left, right) - width.ln();
    }
    // At a bound the density is finite and nonzero only if its exponent there is zero (parameter one).
    match (left == 0.0, a == 1.0, b == 1.0) {
        (true, true, _) => b.ln() - width.ln(),
        (false, _, true) => a.ln() - width.ln(),
        _ => f64::NEG_INFINITY,
    }
}
