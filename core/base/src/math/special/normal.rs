//! Normal distribution and inverse error function.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_2_SQRT_PI, PI, SQRT_2};

use super::{HALF_LN_TWO_PI, continued_fraction, five_point_rule, ln_one_minus_exp};

/// Probability that a standard normal variable is below `z`.
pub fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// Logarithm of [`normal_cdf`], accurate where that underflows.
pub fn ln_normal_cdf(z: f64) -> f64 {
    if z == f64::NEG_INFINITY {
        z
    } else if z < -20.0 {
        // Laplace's continued fraction of Mills' ratio: 1/(x + 1/(x + 2/(x + ...))).
        let x = -z;
        -0.5 * x * x - HALF_LN_TWO_PI - continued_fraction(x, |n| (n, x)).ln()
    } else if z < 1.0 {
        normal_cdf(z).ln()
    } else {
        (-normal_cdf(-z)).ln_1p()
    }
}

/// Quantile of the standard normal distribution at probability `p`.
pub fn normal_quantile(p: f64) -> f64 {
    if !(0.0..=1.0).contains(&p) {
        f64::NAN
    } else if (2.0 * p - 1.0).abs() <= 0.5 {
        SQRT_2 * inverse_erf(2.0 * p - 1.0)
    } else if p < 0.5 {
        lower_quantile(p)
    } else {
        -lower_quantile(1.0 - p)
    }
}

/// Quantile of a small probability: Abramowitz and Stegun 26.2.23, refined by Halley steps.
fn lower_quantile(p: f64) -> f64 {
    if p == 0.0 {
        return f64::NEG_INFINITY;
    }
    let t = (-2.0 * p.ln()).sqrt();
    let numerator = 2.515_517 + t * (0.802_853 + t * 0.010_328);
    let denominator = 1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308));
    let mut z = numerator / denominator - t;
    for _ in 0..3 {
        let density = (-0.5 * z * z - HALF_LN_TWO_PI).exp();
        let u = (normal_cdf(z) - p) / density;
        z -= u / (1.0 + 0.5 * z * u);
    }
    z
}

/// Quantile of the standard normal distribution at probability `exp(l)`.
pub fn normal_quantile_of_ln(l: f64) -> f64 {
    if l > -650.0 {
        // The complement keeps its digits where exp(l) is near one.
        return if l > -0.1 { -lower_quantile(-l.exp_m1()) } else { normal_quantile(l.exp()) };
    }
    if l == f64::NEG_INFINITY {
        return l;
    }
    // The log cdf is concave, so Newton steps approach the zero from the left.
    let mut z = -(-2.0 * l).sqrt();
    for _ in 0..50 {
        let value = ln_normal_cdf(z);
        let slope = (-0.5 * z * z - HALF_LN_TWO_PI - value).exp();
        let step = (l - value) / slope;
        z += step;
        if step.abs() <= 4.0 * f64::EPSILON * z.abs() {
            break;
        }
    }
    z
}

/// Inverse of the error function on (-1, 1).
pub fn inverse_erf(p: f64) -> f64 {
    if p.abs() > 0.5 {
        return -p.signum() * lower_quantile(0.5 * (1.0 - p.abs())) * FRAC_1_SQRT_2;
    }
    let mut x = p / FRAC_2_SQRT_PI * (1.0 + PI / 12.0 * p * p);
    for _ in 0..4 {
        let u = (libm::erf(x) - p) / (FRAC_2_SQRT_PI * (-x * x).exp());
        x -= u / (1.0 + x * u);
    }
    x
}

/// `ln(normal_cdf(b) - normal_cdf(a))` for `a < b`, computed in the tail that contains the interval.
pub fn ln_normal_between(a: f64, b: f64) -> f64 {
    ln_normal_on(a, b, b - a)
}

/// `ln(normal_cdf(a + width) - normal_cdf(a))` for a finite `a`, accurate for small widths.
pub fn ln_normal_from(a: f64, width: f64) -> f64 {
    ln_normal_on(a, a + width, width)
}

fn ln_normal_on(a: f64, b: f64, width: f64) -> f64 {
    let middle = a + 0.5 * width;
    if width * middle.abs().max(1.0) < 1.0 {
        // The difference of the two tails would cancel; the density is smooth here, so a quadrature rule is accurate.
        let sum: f64 = five_point_rule()
            .into_iter()
            .flat_map(|(node, weight)| [-0.25, 0.25].map(|c| (c + 0.25 * node, 0.25 * weight)))
            .map(|(t, weight)| weight * (-t * width * (middle + 0.5 * t * width)).exp())
            .sum();
        return sum.ln() + width.ln() - 0.5 * middle * middle - HALF_LN_TWO_PI;
    }
    let (a, b) = if a > 0.0 { (-b, -a) } else { (a, b) };
    let (low, high) = (ln_normal_cdf(a), ln_normal_cdf(b));
    high + ln_one_minus_exp(low - high)
}

#[cfg(test)]
mod tests {
    // Reference values keep the digits that the programs print.
    #![allow(clippy::unreadable_literal)]

    use super::*;

    /// `(z, log(ncdf(z)))`.
    const MPMATH_LN_NCDF: [(f64, f64); 9] = [
        (-1000.0, -500007.82669481216),
        (-50.0, -1254.8313611394199),
        (-21.0, -224.46571583141449),
        (-19.0, -184.36612866916096),
        (-8.0, -35.01343715991455),
        (-1.0, -1.8410216450092636),
        (0.5, -0.3689464152886564),
        (3.0, -0.0013508099647481938),
        (8.0, -6.220960574271786e-16),
    ];

    #[test]
    fn quantiles_invert_the_distribution_function_in_logarithms() {
        for l in [-1e-12, -0.05, -0.5, -3.0, -40.0, -300.0, -649.0, -651.0, -5e3, -1e6] {
            let z = normal_quantile_of_ln(l);
            assert!((ln_normal_cdf(z) / l - 1.0).abs() < 1e-12, "{l}: {z}");
        }
    }

    #[test]
    fn the_far_tail_is_that_of_mpmath() {
        // Source: mpmath 1.4 with 50 digits, log(ncdf(z)).
        for (z, expected) in MPMATH_LN_NCDF {
            assert!((ln_normal_cdf(z) / expected - 1.0).abs() < 1e-14, "{z}");
        }
    }
}
