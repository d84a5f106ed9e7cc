//! Distribution functions, quantiles and draws.

use rand::Rng;

use super::Distribution;
use super::quantiles::Quantiles;
use crate::math::random::uniform;
use crate::math::special::{
    HALF_LN_TWO_PI, beta_tails, gamma_tails, inverse_beta, inverse_erf, inverse_gamma_tails,
    ln_normal_between, ln_normal_cdf, ln_normal_from, ln_sum_exp, normal_cdf, normal_quantile,
    normal_quantile_of_ln,
};

impl Distribution {
    /// Probability of a value at or below `x`.
    pub fn cdf(&self, x: f64) -> f64 {
        let (lo, hi) = self.support();
        if x.is_nan() {
            return f64::NAN;
        }
        if x <= lo {
            return 0.0;
        }
        if x >= hi {
            return 1.0;
        }
        match *self {
            Self::Uniform([lo, hi]) => (x - lo) / (hi - lo),
            Self::Normal([mean, sd]) => normal_cdf((x - mean) / sd),
            Self::HalfNormal(scale) => libm::erf(x / scale * std::f64::consts::FRAC_1_SQRT_2),
            Self::LogNormal([mu, sigma]) => normal_cdf((x.ln() - mu) / sigma),
            Self::LogUniform([lo, hi]) => ln_ratio(lo, x) / ln_ratio(lo, hi),
            Self::Gamma([shape, scale]) => gamma_tails(shape, x / scale).0.exp(),
            Self::InverseGamma([shape, scale]) => gamma_tails(shape, scale / x).1.exp(),
            Self::Beta([a, b, lo, hi]) => {
                beta_tails(a, b, (x - lo) / (hi - lo), (hi - x) / (hi - lo)).0.exp()
            }
            Self::Exponential(mean) => -(-x / mean).exp_m1(),
            Self::StudentT([dof, location, scale]) => student_cdf(dof, (x - location) / scale),
            Self::HalfStudentT([dof, scale]) => student_size_cdf(dof, x / scale),
            Self::TruncatedNormal([mean, sd, lo, hi]) => {
                // Near the lower bound the distance from it is known to more digits than `x` itself.
                let (a, z, width) = ((lo - mean) / sd, (x - mean) / sd, (x - lo) / sd);
                let below =
                    if width < 1.0 { ln_normal_from(a, width) } else { ln_normal_between(a, z) };
                (below - ln_normal_between((lo - mean) / sd, (hi - mean) / sd)).exp().min(1.0)
            }
            Self::Quantiles(ref n) => normal_cdf(Quantiles::of(n).score(x)),
            Self::Triangular([lo, mode, hi]) if x <= mode => {
                (x - lo) * (x - lo) / ((hi - lo) * (mode - lo))
            }
            Self::Triangular([lo, mode, hi]) => {
                1.0 - (hi - x) * (hi - x) / ((hi - lo) * (hi - mode))
            }
        }
    }

    /// Quantile: the value at or below which a draw lies with probability `p`; NaN unless `0 <= p <= 1`.
    pub fn quantile(&self, p: f64) -> f64 {
        if !(0.0..=1.0).contains(&p) {
            return f64::NAN;
        }
        let (lo, hi) = self.support();
        if p == 0.0 {
            return lo;
        }
        if p == 1.0 {
            return hi;
        }
        let q = 1.0 - p;
        let x = match *self {
            // A convex combination instead of `lo + p (hi - lo)`: it is monotone, and exact at both ends.
            Self::Uniform([lo, hi]) => lo * q + hi * p,
            Self::Normal([mean, sd]) => mean + sd * normal_quantile(p),
            Self::HalfNormal(scale) => scale * std::f64::consts::SQRT_2 * inverse_erf(p),
            Self::LogNormal([mu, sigma]) => (mu + sigma * normal_quantile(p)).exp(),
            Self::LogUniform([lo, hi]) => log_uniform_quantile(lo, hi, p),
            Self::Gamma([shape, scale]) => scale * inverse_gamma_tails(shape, p, q),
            Self::InverseGamma([shape, scale]) => scale / inverse_gamma_tails(shape, q, p),
            Self::Beta([a, b, lo, hi]) => {
                let (x, y) = inverse_beta(a, b, p, q);
                if x <= 0.5 { lo + (hi - lo) * x } else { hi - (hi - lo) * y }
            }
            Self::Exponential(mean) => -mean * (-p).ln_1p(),
            Self::StudentT([dof, location, scale]) => location + scale * student_quantile(dof, p),
            Self::HalfStudentT([dof, scale]) => scale * student_quantile_of_size(dof, q, p),
            Self::TruncatedNormal([mean, sd, lo, hi]) => {
                let (a, b) = ((lo - mean) / sd, (hi - mean) / sd);
                let z = truncated_quantile(a, b, p, q);
                if p <= q && z - a < 1.0 {
                    lo + sd * offset_from_bound(a, b, z - a, p)
                } else if p > q && b - z < 1.0 {
                    hi - sd * offset_from_bound(-b, -a, b - z, q)
                } else {
                    mean + sd * z
                }
            }
            Self::Quantiles(ref n) => Quantiles::of(n).at_score(normal_quantile(p)),
            Self::Triangular([lo, mode, hi]) if p * (hi - lo) <= mode - lo => {
                lo + (p * (hi - lo) * (mode - lo)).sqrt()
            }
            Self::Triangular([lo, mode, hi]) => hi - (q * (hi - lo) * (hi - mode)).sqrt(),
        };
        x.clamp(lo, hi)
    }

    /// One draw: the quantile of one uniform number, so that each draw consumes the same amount of the stream.
    pub fn sample(&self, rng: &mut impl Rng) -> f64 {
        self.quantile(uniform(rng))
    }
}

/// `ln(x / lo)`: near the lower bound the difference keeps the digits that the ratio loses.
pub(super) fn ln_ratio(lo: f64, x: f64) -> f64 {
    let excess = (x - lo) / lo;
    if excess.is_finite() { excess.ln_1p() } else { x.ln() - lo.ln() }
}

fn log_uniform_quantile(lo: f64, hi: f64, p: f64) -> f64 {
    let factor = (p * ln_ratio(lo, hi)).exp();
    if factor.is_finite() { lo * factor } else { ((1.0 - p) * lo.ln() + p * hi.ln()).exp() }
}

/// The logarithms of the probabilities of a size of Student's t above and below that of `t`.
fn student_tails(dof: f64, t: f64) -> (f64, f64) {
    // For large t, dividing keeps the degrees of freedom from being lost beside t^2.
    let r = t / dof.sqrt();
    let (x, y) = if r.abs() > 1.0 {
        let s = 1.0 / (r * r);
        (s / (1.0 + s), 1.0 / (1.0 + s))
    } else {
        (1.0 / (1.0 + r * r), r * r / (1.0 + r * r))
    };
    beta_tails(0.5 * dof, 0.5, x, y)
}

/// Degrees of freedom above which Wallace's normal score of Student's t (Annals of Mathematical Statistics 30 (1959)
/// 1121) is exact to double precision: its error is of the order `t^3 / (50 dof^2)`. The incomplete beta function needs ever
/// more terms there.
pub(super) const LARGE_FREEDOM: f64 = 1e10;

/// The factor of Wallace's score, `(8 dof + 1) / (8 dof + 3)`.
fn wallace(dof: f64) -> f64 {
    1.0 - 2.0 / (8.0 * dof + 3.0)
}

/// The normal score of Student's t with many degrees of freedom.
fn score_of_student(dof: f64, t: f64) -> f64 {
    let r = (t / dof.sqrt()).powi(2);
    let ratio = if r > 0.0 && r.is_finite() { r.ln_1p() / r } else { 1.0 };
    t * ratio.sqrt() * wallace(dof)
}

/// Student's t with many degrees of freedom, of this normal score.
fn student_of_score(dof: f64, z: f64) -> f64 {
    let u = z / wallace(dof);
    let r = (u / dof.sqrt()).powi(2);
    let ratio = if r > 0.0 && r.is_finite() { r.exp_m1() / r } else { 1.0 };
    u * ratio.sqrt()
}

/// The probability of a size of Student's t below that of `t`.
fn student_size_cdf(dof: f64, t: f64) -> f64 {
    if dof > LARGE_FREEDOM {
        return libm::erf(score_of_student(dof, t) * std::f64::consts::FRAC_1_SQRT_2);
    }
    student_tails(dof, t).1.exp()
}

fn student_cdf(dof: f64, t: f64) -> f64 {
    if dof > LARGE_FREEDOM {
        return normal_cdf(score_of_student(dof, t));
    }
    let tail = 0.5 * student_tails(dof, t).0.exp();
    if t < 0.0 { tail } else { 1.0 - tail }
}

fn student_quantile(dof: f64, p: f64) -> f64 {
    let tail = p.min(1.0 - p);
    let t = student_quantile_of_size(dof, 2.0 * tail, (1.0 - 2.0 * p).abs());
    if p < 0.5 { -t } else { t }
}

/// The size of Student's t with these probabilities of larger and of smaller ones.
fn student_quantile_of_size(dof: f64, larger: f64, smaller: f64) -> f64 {
    if dof > LARGE_FREEDOM {
        let z = if larger <= smaller {
            -normal_quantile(0.5 * larger)
        } else {
            std::f64::consts::SQRT_2 * inverse_erf(smaller)
        };
        return student_of_score(dof, z);
    }
    let (x, y) = inverse_beta(0.5 * dof, 0.5, larger, smaller);
    dof.sqrt() * (y / x).sqrt()
}

/// Quantile of a standard normal variable truncated to `a` and `b`, computed with logarithms in the tail that contains
/// the interval.
fn truncated_quantile(a: f64, b: f64, p: f64, q: f64) -> f64 {
    if a > 0.0 {
        return -truncated_quantile(-b, -a, q, p);
    }
    let inside = ln_normal_between(a, b);
    let below = ln_sum_exp(ln_normal_cdf(a), inside + p.ln());
    let above = ln_sum_exp(ln_normal_cdf(-b), inside + q.ln());
    if below <= above { normal_quantile_of_ln(below) } else { -normal_quantile_of_ln(above) }
}

/// Distance from the lower bound `a`, refined by Newton steps in its logarithm: near a bound the distance is known to
/// more digits than the quantile.
fn offset_from_bound(a: f64, b: f64, start: f64, p: f64) -> f64 {
    let target = ln_normal_between(a, b) + p.ln();
    let ln_density = |z: f64| -0.5 * z * z - HALF_LN_TWO_PI;
    let linear = (target - ln_density(a)).exp();
    let mut offset = if start > 1e-6 { start } else { linear };
    for _ in 0..3 {
        let value = ln_normal_from(a, offset);
        let slope = (ln_density(a + offset) - value).exp() * offset;
        offset *= ((target - value) / slope).exp();
    }
    if offset.is_finite() { offset } else { start }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_degrees_of_freedom_give_the_normal_law() {
        for dof in [2e10, 1e17, 1e100, 1.7e308] {
            let student = Distribution::StudentT([dof, 3.0, 2.0]);
            let half = Distribution::HalfStudentT([dof, 2.0]);
            for p in [1e-12, 0.001, 0.3, 0.5, 0.8, 0.999] {
                let (x, size) = (student.quantile(p), half.quantile(p));
                let normal = Distribution::Normal([3.0, 2.0]);
                // The first term of the difference, `(z^3 + z) / (4 dof)`, is below 5e-9 here, in units of the scale.
                assert!((x - normal.quantile(p)).abs() < 2e-8, "{dof}, {p}: {x}");
                assert!((student.cdf(x) / p - 1.0).abs() < 1e-12, "{dof}, {p}: {x}");
                assert!((half.cdf(size) / p - 1.0).abs() < 1e-12, "{dof}, {p}: {size}");
                let density = student.log_density(x);
                assert!((density - normal.log_density(x)).abs() < 1e-6, "{dof}, {p}: {density}");
            }
        }
        // Both forms give `t = z + (z^3 + z) / (4 dof) + (5 z^5 + 16 z^3 + 3 z) / (96 dof^2)` (Abramowitz and Stegun 26.7.5); the
        // density of the beta distribution is accurate to about `dof` times the rounding error.
        let z = normal_quantile(0.99);
        let expected = z + (z.powi(3) + z) / (4.0 * 1e9);
        assert!((student_of_score(1e9, z) / expected - 1.0).abs() < 1e-14);
        let second = 5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z;
        let expected = z + (z.powi(3) + z) / (4.0 * 1e4) + second / (96.0 * 1e8);
        assert!((student_quantile(1e4, 0.99) / expected - 1.0).abs() < 1e-11);
    }
}
