//! The incomplete gamma function.

use super::{
    HALF_LN_TWO_PI, continued_fraction, deviance, increasing_zero, ln_one_minus_exp, stirling_error,
};

/// The logarithm of the gamma function for positive arguments.
pub fn ln_gamma(x: f64) -> f64 {
    libm::lgamma(x)
}

/// The logarithm of the density of the gamma law with this shape and scale one.
pub fn ln_gamma_density(shape: f64, x: f64) -> f64 {
    // The Poisson probability x^a e^-x / a!, times a / x.
    shape.ln() - x.ln() + ln_poisson(shape, x)
}

fn ln_poisson(a: f64, x: f64) -> f64 {
    if a < 15.0 {
        a * x.ln() - x - ln_gamma(a + 1.0)
    } else {
        -stirling_error(a) - deviance(a, x) - HALF_LN_TWO_PI - 0.5 * a.ln()
    }
}

/// The logarithms of the regularised incomplete gamma functions `P(a, x)` and `Q(a, x)`, the
/// probabilities below and above `x`.
///
/// Series and continued fraction as in Press et al., Numerical Recipes, section 6.2.
pub fn gamma_tails(a: f64, x: f64) -> (f64, f64) {
    if x <= 0.0 {
        return (f64::NEG_INFINITY, 0.0);
    }
    if x == f64::INFINITY {
        return (0.0, f64::NEG_INFINITY);
    }
    let front = ln_poisson(a, x);
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0, 1.0, a);
        // Beyond 2^53 a shape no longer changes by one; the bound keeps the loop finite.
        while term > f64::EPSILON * sum * 0.1 && sum < 1e7 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        let lower = (front + f64::ln(sum)).min(0.0);
        (lower, ln_one_minus_exp(lower))
    } else {
        let fraction = continued_fraction(x + 1.0 - a, |n| (-n * (n - a), x + 2.0 * n + 1.0 - a));
        let upper = (front + a.ln() - fraction.ln()).min(0.0);
        (ln_one_minus_exp(upper), upper)
    }
}

/// The `x` with `P(a, x) = p` and `Q(a, x) = q`, where `p + q = 1`; the smaller one is used.
pub fn inverse_gamma_tails(a: f64, p: f64, q: f64) -> f64 {
    if p == 0.0 {
        return 0.0;
    }
    if q == 0.0 {
        return f64::INFINITY;
    }
    let (ln_p, ln_q) = (p.ln(), q.ln());
    // Near zero P(a, x) is x^a / a!; elsewhere the mean is a safe start.
    let start = ((ln_p + ln_gamma(a + 1.0)) / a).min(a.ln());
    let u = increasing_zero(-700.0, 709.0, start, |u| {
        let x = u.exp();
        let (lower, upper) = gamma_tails(a, x);
        let ln_slope = ln_gamma_density(a, x) + u;
        if p <= q {
            (lower - ln_p, (ln_slope - lower).exp())
        } else {
            (ln_q - upper, (ln_slope - upper).exp())
        }
    });
    if u <= -699.0 { 0.0 } else { u.exp() }
}
