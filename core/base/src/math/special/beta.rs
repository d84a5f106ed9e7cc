//! Incomplete beta function.

use super::{
    HALF_LN_TWO_PI, continued_fraction, deviance, increasing_zero, ln_one_minus_exp, stirling_error,
};

/// Logarithm of the density of the beta distribution on (0, 1) at `x`, where `y = 1 - x`.
///
/// Loader's binomial probability (2000), which stays accurate for large shapes.
pub fn ln_beta_density(a: f64, b: f64, x: f64, y: f64) -> f64 {
    let n = a + b;
    let binomial = stirling_error(n)
        - stirling_error(a)
        - stirling_error(b)
        - deviance(a, n * x)
        - deviance(b, n * y);
    binomial + 0.5 * (a.ln() + b.ln() - n.ln()) - HALF_LN_TWO_PI - x.ln() - y.ln()
}

/// Logarithms of the regularised incomplete beta function `I_x(a, b)` and of its complement, the probabilities below
/// and above `x`, where `y = 1 - x`.
///
/// Continued fraction as in Press et al., Numerical Recipes, section 6.4.
pub fn beta_tails(a: f64, b: f64, x: f64, y: f64) -> (f64, f64) {
    if x <= 0.0 {
        (f64::NEG_INFINITY, 0.0)
    } else if y <= 0.0 {
        (0.0, f64::NEG_INFINITY)
    } else if x * (a + b + 2.0) < a + 1.0 {
        let lower = lower_tail(a, b, x, y).min(0.0);
        (lower, ln_one_minus_exp(lower))
    } else {
        let upper = lower_tail(b, a, y, x).min(0.0);
        (ln_one_minus_exp(upper), upper)
    }
}

fn lower_tail(a: f64, b: f64, x: f64, y: f64) -> f64 {
    let fraction = continued_fraction(1.0, |n| {
        let m = (n / 2.0).floor();
        let d = if n % 2.0 == 0.0 {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        };
        (d, 1.0)
    });
    ln_beta_density(a, b, x, y) + x.ln() + y.ln() - a.ln() - fraction.ln()
}

/// The pair `(x, 1 - x)` with `I_x(a, b) = p` and complement `q`, where `p + q = 1`.
pub fn inverse_beta(a: f64, b: f64, p: f64, q: f64) -> (f64, f64) {
    if p == 0.0 {
        return (0.0, 1.0);
    }
    if q == 0.0 {
        return (1.0, 0.0);
    }
    // Find the half that contains x, so that the smaller of x and 1 - x is the unknown of the equation.
    let (below, above) = beta_tails(a, b, 0.5, 0.5);
    let left = if p <= q { p.ln() <= below } else { q.ln() >= above };
    if left {
        let x = lower_inverse(a, b, p, q);
        (x, 1.0 - x)
    } else {
        let y = lower_inverse(b, a, q, p);
        (1.0 - y, y)
    }
}

/// The solution, known to be at most one half, found in its logarithm.
fn lower_inverse(a: f64, b: f64, p: f64, q: f64) -> f64 {
    let (ln_p, ln_q) = (p.ln(), q.ln());
    let ln_beta = |a: f64, b: f64| libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    let start = (ln_p + a.ln() + ln_beta(a, b)) / a;
    let u = increasing_zero(-700.0, -std::f64::consts::LN_2, start, |u| {
        let x = u.exp();
        let (lower, upper) = beta_tails(a, b, x, 1.0 - x);
        let ln_slope = ln_beta_density(a, b, x, 1.0 - x) + u;
        if p <= q {
            (lower - ln_p, (ln_slope - lower).exp())
        } else {
            (ln_q - upper, (ln_slope - upper).exp())
        }
    });
    if u <= -699.0 { 0.0 } else { u.exp() }
}
