//! Special functions with small relative error far into the tails, as needed to invert priors.

mod beta;
mod from_statrs;
mod gamma;
mod normal;

pub use beta::{beta_tails, inverse_beta, ln_beta_density};
pub use from_statrs::{digamma, ln_binomial, student_t_cdf, student_t_quantile};
pub use gamma::{
    gamma_tails, inverse_gamma_tails, inverse_ln_minus_digamma, ln_gamma, ln_gamma_density,
    ln_gamma_half_step, ln_minus_digamma,
};
pub use normal::{
    inverse_erf, ln_normal_between, ln_normal_cdf, ln_normal_from, normal_cdf, normal_quantile,
    normal_quantile_of_ln,
};

/// `ln(2 pi) / 2`.
pub const HALF_LN_TWO_PI: f64 = 0.918_938_533_204_672_8;

/// `ln(1 - exp(x))` for `x <= 0` without cancellation (Mächler, 2012).
pub fn ln_one_minus_exp(x: f64) -> f64 {
    if x > -std::f64::consts::LN_2 { (-x.exp_m1()).ln() } else { (-x.exp()).ln_1p() }
}

/// `ln(1 + x) - x` without cancellation for small `x`; minus infinity at minus one.
pub fn ln_one_plus_minus(x: f64) -> f64 {
    if x.abs() >= 0.1 {
        return x.ln_1p() - x;
    }
    // ln((1 + r) / (1 - r)) = 2 (r + r³/3 + ...) with r = x / (2 + x), and x - 2r = r x.
    let r = x / (2.0 + x);
    let square = r * r;
    let odd = (1..12).rev().fold(0.0, |sum, k| square * (sum + 1.0 / f64::from(2 * k + 1)));
    r * (2.0 * odd - x)
}

/// `ln(exp(a) + exp(b))` without overflow.
pub fn ln_sum_exp(a: f64, b: f64) -> f64 {
    let (large, small) = if a > b { (a, b) } else { (b, a) };
    if small == f64::NEG_INFINITY { large } else { large + (small - large).exp().ln_1p() }
}

/// Gauss-Legendre rule with five points on (-1, 1), as `(node, weight)` (Abramowitz and Stegun 25.4.30).
pub fn five_point_rule() -> [(f64, f64); 5] {
    let root = (10.0_f64 / 7.0).sqrt();
    let (near, far) = ((5.0 - 2.0 * root).sqrt() / 3.0, (5.0 + 2.0 * root).sqrt() / 3.0);
    let heavy = (322.0 + 13.0 * 70.0_f64.sqrt()) / 900.0;
    let light = (322.0 - 13.0 * 70.0_f64.sqrt()) / 900.0;
    [(-far, light), (-near, heavy), (0.0, 128.0 / 225.0), (near, heavy), (far, light)]
}

/// Zero of an increasing difference of logarithms on an interval: Newton steps, with bisection if they leave the
/// bracket. `f` returns value and slope. Without a zero, the bound nearest to one.
fn increasing_zero(lo: f64, hi: f64, start: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut lo, mut hi) = (lo, hi);
    let mut x = start.clamp(lo, hi);
    for step in 1..=400 {
        let (value, slope) = f(x);
        if value == 0.0 {
            return x;
        }
        if value < 0.0 {
            lo = x;
        } else {
            hi = x;
        }
        let newton = x - value / slope;
        // Far from the zero the slope may be dominated by rounding error, so that a short step is no sign of
        // convergence, and every fourth step is a bisection.
        let near = value.abs() < 1e-6;
        let short = (newton - x).abs() <= 2.0 * f64::EPSILON * x.abs();
        if short && near || hi - lo <= f64::EPSILON * x.abs() {
            return x;
        }
        let inside = newton > lo && newton < hi && !short && (near || step % 4 != 0);
        x = if inside { newton } else { 0.5 * (lo + hi) };
    }
    x
}

/// The error of Stirling's formula, `ln n! - ln(sqrt(2 pi n) (n/e)^n)` (Loader, 2000).
fn stirling_error(n: f64) -> f64 {
    if n < 15.0 {
        return ln_gamma(n + 1.0) - (n + 0.5) * n.ln() + n - HALF_LN_TWO_PI;
    }
    let m = 1.0 / (n * n);
    (1.0 / 12.0
        - m * (1.0 / 360.0
            - m * (1.0 / 1260.0
                - m * (1.0 / 1680.0 - m * (1.0 / 1188.0 - m * (691.0 / 360_360.0))))))
        / n
}

/// The deviance `a ln(a / m) + m - a` without cancellation where `a` and `m` are near (Loader, 2000).
fn deviance(a: f64, m: f64) -> f64 {
    if (a - m).abs() >= 0.1 * (a + m) {
        return a * (a.ln() - m.ln()) + m - a;
    }
    let v = (a - m) / (a + m);
    let mut sum = (a - m) * v;
    let mut power = 2.0 * a * v;
    for j in 1..1000 {
        power *= v * v;
        let next = sum + power / f64::from(2 * j + 1);
        if next == sum {
            break;
        }
        sum = next;
    }
    sum
}

/// A continued fraction `b0 + a1/(b1 + a2/(b2 + ...))` by the modified method of Lentz
/// (Press et al., Numerical Recipes, section 5.2); `terms(n)` gives `(a_n, b_n)`.
fn continued_fraction(b0: f64, terms: impl Fn(f64) -> (f64, f64)) -> f64 {
    const TINY: f64 = 1e-300;
    let guard = |x: f64| if x.abs() < TINY { TINY } else { x };
    let mut value = guard(b0);
    let (mut c, mut d) = (value, 0.0);
    for n in 1..100_000 {
        let (a, b) = terms(f64::from(n));
        d = 1.0 / guard(b + a * d);
        c = guard(b + a / c);
        let factor = c * d;
        value *= factor;
        if (factor - 1.0).abs() <= f64::EPSILON {
            break;
        }
    }
    value
}
