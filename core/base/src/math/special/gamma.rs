//! Incomplete gamma function.

use super::{
    HALF_LN_TWO_PI, continued_fraction, deviance, increasing_zero, ln_normal_cdf, ln_one_minus_exp,
    stirling_error,
};

/// Logarithm of the gamma function for positive arguments.
pub fn ln_gamma(x: f64) -> f64 {
    libm::lgamma(x)
}

/// `ln_gamma(x + 1/2) - ln_gamma(x)` for positive arguments, without cancellation for large ones.
pub fn ln_gamma_half_step(x: f64) -> f64 {
    if x < 15.0 {
        return ln_gamma(x + 0.5) - ln_gamma(x);
    }
    let curved = stirling_error(x + 0.5) - stirling_error(x);
    0.5 * x.ln() + (x * (0.5 / x).ln_1p() - 0.5) + curved
}

/// `ln x - psi(x)`, where `psi` is the digamma function, and its derivative, for positive arguments; NaN for others.
///
/// Both are small differences of large numbers if `x` is large: recurrence below 12, then the asymptotic series
/// (Abramowitz and Stegun 6.3.5, 6.3.18, 6.4.6 and 6.4.12).
pub fn ln_minus_digamma(x: f64) -> (f64, f64) {
    if x.is_nan() || x <= 0.0 {
        return (f64::NAN, f64::NAN);
    }
    let (mut sum, mut slope, mut z) = (0.0, 0.0, x);
    // At most twelve iterations, because every argument is above zero.
    while z < 12.0 {
        sum += 1.0 / z;
        slope -= 1.0 / (z * z);
        z += 1.0;
    }
    if z > x {
        sum += (x / z).ln();
        slope += 1.0 / x - 1.0 / z;
    }
    let y = 1.0 / (z * z);
    let series =
        1.0 / 12.0 - y * (1.0 / 120.0 - y * (1.0 / 252.0 - y * (1.0 / 240.0 - y * (1.0 / 132.0))));
    let steep =
        1.0 / 6.0 - y * (1.0 / 30.0 - y * (1.0 / 42.0 - y * (1.0 / 30.0 - y * (5.0 / 66.0))));
    (sum + 0.5 / z + y * series, slope - y * (0.5 + steep / z))
}

/// The positive `x` with `ln x - psi(x) = gap`, for a positive `gap`: the shape of the gamma distribution whose mean
/// logarithm lies that far below the logarithm of its mean.
pub fn inverse_ln_minus_digamma(gap: f64) -> f64 {
    let ln_gap = gap.ln();
    // The solution is near `1 / (2 gap)` for small gaps and `1 / gap` for large ones, straight lines in logarithms.
    let start = if gap < 1.0 { -(2.0 * gap).ln() } else { -ln_gap };
    let u = increasing_zero(-700.0, 700.0, start, |u| {
        let x = u.exp();
        let (value, slope) = ln_minus_digamma(x);
        (ln_gap - value.ln(), -slope * x / value)
    });
    u.exp()
}

/// Logarithm of the density of the gamma distribution with this shape and scale one.
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

/// Logarithms of the regularised incomplete gamma functions `P(a, x)` and `Q(a, x)`, the probabilities below and above
/// `x`.
///
/// Series and continued fraction as in Press et al., Numerical Recipes, section 6.2.
pub fn gamma_tails(a: f64, x: f64) -> (f64, f64) {
    if x <= 0.0 {
        return (f64::NEG_INFINITY, 0.0);
    }
    if x == f64::INFINITY {
        return (0.0, f64::NEG_INFINITY);
    }
    // The number of terms of series and fraction grows with the square root of the shape.
    if a > LARGE_SHAPE && (x - a).abs() < 0.3 * a {
        return uniform_tails(a, x);
    }
    let front = ln_poisson(a, x);
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0, 1.0, a);
        // Beyond 2^53 adding one no longer changes a shape; the bound keeps the loop finite.
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

/// Shape above which the uniform expansion is accurate to all digits.
const LARGE_SHAPE: f64 = 1e4;

/// [`gamma_tails`] for a large shape and `x` near it: Temme's uniform expansion
/// `Q(a, x) = erfc(eta sqrt(a/2)) / 2 + exp(-a eta²/2) / sqrt(2 pi a) Σ c_k(eta) a^-k` (Temme, SIAM J. Math. Anal. 10
/// (1979) 757).
fn uniform_tails(a: f64, x: f64) -> (f64, f64) {
    let half_square = deviance(a, x);
    let sign = if x < a { -1.0 } else { 1.0 };
    let z = sign * (2.0 * half_square).sqrt();
    let eta = z / a.sqrt();
    let by_shape = COEFFICIENTS
        .iter()
        .rev()
        .fold(0.0, |sum, of_eta| sum / a + of_eta.iter().rev().fold(0.0, |sum, c| sum * eta + c));
    let ln_density = -half_square - HALF_LN_TWO_PI - 0.5 * a.ln();
    let tail = |ln_normal: f64, correction: f64| {
        (ln_normal + (correction * (ln_density - ln_normal).exp()).ln_1p()).min(0.0)
    };
    // The smaller tail is computed to all digits, the other as its complement.
    if x < a {
        let lower = tail(ln_normal_cdf(z), -by_shape);
        (lower, ln_one_minus_exp(lower))
    } else {
        let upper = tail(ln_normal_cdf(-z), by_shape);
        (ln_one_minus_exp(upper), upper)
    }
}

/// Coefficients of the powers of `eta` in `c_0` to `c_3`: `c_0 = 1/mu - 1/eta` and
/// `eta c_k = c_{k-1}' + gamma_k eta/mu` with `eta²/2 = mu - ln(1 + mu)` and the coefficients `gamma_k` of Stirling's
/// series, in rational arithmetic. As many as contribute above a shape of [`LARGE_SHAPE`].
const COEFFICIENTS: [&[f64]; 4] = [
    &[
        -1.0 / 3.0,
        1.0 / 12.0,
        -2.0 / 135.0,
        1.0 / 864.0,
        1.0 / 2835.0,
        -1.787_551_440_329_218e-4,
        3.919_263_178_522_438e-5,
        -2.185_448_510_679_992e-6,
        -1.854_062_210_715_16e-6,
        8.296_711_340_953_087e-7,
        -1.766_595_273_682_607_8e-7,
        6.707_853_543_401_498e-9,
        1.026_180_978_424_030_9e-8,
        -4.382_036_018_453_353e-9,
        9.147_699_582_236_79e-10,
        -2.551_419_399_494_624_8e-11,
        -5.830_772_132_550_426e-11,
        2.436_194_802_066_741_5e-11,
        -5.027_669_280_114_175e-12,
        1.100_439_203_195_613_5e-13,
    ],
    &[
        -1.851_851_851_851_852e-3,
        -3.472_222_222_222_222e-3,
        2.645_502_645_502_645_4e-3,
        -9.902_263_374_485_596e-4,
        2.057_613_168_724_279_8e-4,
        -4.018_775_720_164_609e-7,
        -1.809_855_033_448_997_7e-5,
        7.649_160_916_081_11e-6,
        -1.612_090_089_456_344_6e-6,
        4.647_127_802_807_434e-9,
        1.378_633_446_915_721e-7,
    ],
    &[
        4.133_597_883_597_883e-3,
        -2.681_327_160_493_827_3e-3,
        7.716_049_382_716_049e-4,
        2.009_387_860_082_304_7e-6,
        -1.073_665_322_636_516e-4,
        5.292_344_882_912_012_5e-5,
    ],
    &[6.494_341_563_786_008e-4, 2.294_720_936_213_991_7e-4],
];

/// The `x` with `P(a, x) = p` and `Q(a, x) = q`, where `p + q = 1`; the smaller one is used.
pub fn inverse_gamma_tails(a: f64, p: f64, q: f64) -> f64 {
    if p == 0.0 {
        return 0.0;
    }
    if q == 0.0 {
        return f64::INFINITY;
    }
    let (ln_p, ln_q) = (p.ln(), q.ln());
    // Near zero P(a, x) is x^a / a!; elsewhere the mean is a safe starting point.
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

#[cfg(test)]
mod tests {
    // Reference values keep the digits as published.
    #![allow(clippy::unreadable_literal, clippy::excessive_precision)]

    use super::*;

    /// `(a, x, ln P(a, x), ln Q(a, x))`.
    const LARGE: [(f64, f64, f64, f64); 28] = [
        (20000.0, 15757.359312880715, -530.17551531231201, -5.5937011459196292e-231),
        (20000.0, 19292.893218813453, -15.366433755025291, -2.120521400250366e-7),
        (20000.0, 19858.578643762692, -1.8410344187958336, -0.1727513702451497),
        (20000.0, 20000.0, -0.69126831426768126, -0.69502958363694159),
        (20000.0, 20070.710678118656, -0.36804687586918626, -1.1779306600141957),
        (20000.0, 20565.68542494924, -3.6660294973462352e-5, -10.213834599482838),
        (20000.0, 24242.640687119285, -3.6842072859507432e-174, -399.34575079760907),
        (1000000.0, 970000.0, -463.52869556025424, -4.9209087785911619e-202),
        (1000000.0, 995000.0, -15.106647347552955, -2.7495807372797476e-7),
        (1000000.0, 999000.0, -1.8410218993793996, -0.17275373105601131),
        (1000000.0, 1000000.0, -0.69288125439969593, -0.69341317745572824),
        (1000000.0, 1000500.0, -0.36881913593320666, -1.1761970657867394),
        (1000000.0, 1004000.0, -3.2345970438739146e-5, -10.339037279116504),
        (1000000.0, 1030000.0, -3.262430144876734e-194, -445.51903567995732),
        (1000000000.0, 999051316.7019495, -454.60605055021313, -3.690632537018029e-198),
        (1000000000.0, 999841886.1169916, -15.066310643543557, -2.8627570115741132e-7),
        (1000000000.0, 999968377.2233983, -1.841021645262898, -0.17275377897562117),
        (1000000000.0, 1000000000.0, -0.69313877015357276, -0.69315559103705339),
        (1000000000.0, 1000015811.3883009, -0.36894239003188011, -1.1759207826421604),
        (1000000000.0, 1000126491.1064067, -3.16929095062902e-5, -10.359433423393333),
        (1000000000.0, 1000948683.2980505, -6.5208585709114777e-198, -454.03684236289675),
        (1e16, 9999997000000000.0, -454.32133395603158, -4.9062723442951984e-198),
        (1e16, 9999999500000000.0, -15.064998808909059, -2.8665149402618852e-7),
        (1e16, 9999999900000000.0, -1.8410216450092635, -0.17275377902344988),
        (1e16, 1e16, -0.69314717790033011, -0.69314718321956052),
        (1e16, 1.000000005e16, -0.36894641401575531, -1.175911764446313),
        (1e16, 1.00000004e16, -3.1671750069212991e-5, -10.36010127524694),
        (1e16, 1.0000003e16, -4.9071555495465434e-198, -454.32115395669531),
    ];

    #[test]
    fn tails_of_large_shapes_are_those_of_mpmath() {
        // Source: mpmath 1.3 with 60 digits, the integral of the density over the smaller tail by `quad`.
        for (a, x, lower, upper) in LARGE {
            let found = gamma_tails(a, x);
            // The deviance of the density is accurate to one rounding of itself, and so is the logarithm of a tail.
            for (found, expected) in [(found.0, lower), (found.1, upper)] {
                let limit = 1e-13 * expected.abs().max(1e-3);
                let relative = expected.abs() < 1e-6 && (found / expected - 1.0).abs() < 1e-11;
                assert!(relative || (found - expected).abs() < limit, "{a} {x}: {found}");
            }
        }
    }

    #[test]
    fn the_two_ways_meet() {
        for z in [-8.0, -2.0, -0.1, 0.0, 0.3, 3.0, 9.0] {
            let a = 1.0 + LARGE_SHAPE;
            let x = a + z * a.sqrt();
            let (uniform, below) = (uniform_tails(a, x), 0.999_99 * LARGE_SHAPE);
            let front = ln_poisson(a, x);
            let series = if z <= 0.0 {
                let (mut term, mut sum, mut n) = (1.0, 1.0, a);
                while term > 1e-18 * sum {
                    n += 1.0;
                    term *= x / n;
                    sum += term;
                }
                (front + f64::ln(sum), uniform.0)
            } else {
                let f = continued_fraction(x + 1.0 - a, |n| (-n * (n - a), x + 2.0 * n + 1.0 - a));
                (front + a.ln() - f.ln(), uniform.1)
            };
            assert!((series.0 - series.1).abs() < 1e-12, "{z}: {series:?} {below}");
        }
    }

    #[test]
    fn shapes_that_belong_to_a_gap_are_those_of_mpmath() {
        // Source: mpmath 1.3 with 40 digits, findroot(log(x) - digamma(x) - gap).
        for (gap, shape) in [
            (1e-14, 50000000000000.167),
            (5e-11, 10000000000.166667),
            (1e-6, 500000.16666661111),
            (0.01, 50.166108206602331),
            (0.3, 1.8155497629688562),
            (2.0, 0.33811677188001255),
            (50.0, 0.018715531507539926),
            (1e6, 9.9998676186547433e-7),
        ] {
            let found = inverse_ln_minus_digamma(gap);
            assert!((found / shape - 1.0).abs() < 1e-13, "{gap}: {found}");
        }
        for gap in [f64::MIN_POSITIVE, 1e-300, 1e300, f64::INFINITY, 0.0, -1.0, f64::NAN] {
            // The call must terminate at once for any argument.
            inverse_ln_minus_digamma(gap);
        }
        for x in [0.0, -1.0, -1e16, f64::NEG_INFINITY, f64::NAN] {
            assert!(ln_minus_digamma(x).0.is_nan(), "{x}");
        }
    }

    #[test]
    fn half_a_step_of_the_gamma_function_keeps_its_digits() {
        // The expansion `ln(x)/2 - 1/(8x) + 1/(192 x^3) - ...` (Tricomi and Erdelyi, 1951).
        for x in [20.0_f64, 1e3, 1e8, 1e15] {
            let expected =
                0.5 * x.ln() - 0.125 / x + 1.0 / (192.0 * x.powi(3)) - 1.0 / (640.0 * x.powi(5));
            let found = ln_gamma_half_step(x);
            assert!((found - expected).abs() < 1e-10 / x + 1e-15 * expected.abs(), "{x}: {found}");
        }
        assert!((ln_gamma_half_step(14.9) - ln_gamma(15.4) + ln_gamma(14.9)).abs() < 1e-13);
    }
}
