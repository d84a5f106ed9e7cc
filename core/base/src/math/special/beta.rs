//! Incomplete beta function.

use super::{
    HALF_LN_TWO_PI, continued_fraction, deviance, increasing_zero, ln_one_minus_exp, stirling_error,
};

/// The shapes of a beta distribution, with the parts of its density that do not depend on the place.
struct Shapes {
    a: f64,
    b: f64,
    stirling: f64,
    half_logs: f64,
}

impl Shapes {
    fn new(a: f64, b: f64) -> Self {
        let n = a + b;
        let stirling = stirling_error(n) - stirling_error(a) - stirling_error(b);
        Self { a, b, stirling, half_logs: 0.5 * (a.ln() + b.ln() - n.ln()) }
    }

    /// Loader's binomial probability (2000), which stays accurate for large shapes.
    fn ln_density(&self, x: f64, y: f64) -> f64 {
        let Self { a, b, stirling, half_logs } = *self;
        let n = a + b;
        let binomial = stirling - deviance(a, n * x) - deviance(b, n * y);
        binomial + half_logs - HALF_LN_TWO_PI - x.ln() - y.ln()
    }

    /// Logarithm of the probability below `x`, which converges fast for `x` below the mean.
    fn ln_lower(&self, x: f64, y: f64) -> f64 {
        let Self { a, b, .. } = *self;
        let fraction = continued_fraction(1.0, |n| {
            let m = (n / 2.0).floor();
            let d = if n == 2.0 * m {
                m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
            } else {
                -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
            };
            (d, 1.0)
        });
        self.ln_density(x, y) + x.ln() + y.ln() - a.ln() - fraction.ln()
    }
}

/// A beta distribution and its mirror image.
struct Mirrored {
    own: Shapes,
    mirror: Shapes,
}

impl Mirrored {
    /// See [`beta_tails`].
    fn tails(&self, x: f64, y: f64) -> (f64, f64) {
        let Shapes { a, b, .. } = self.own;
        tails([a, b], [x, y], || self.own.ln_lower(x, y), || self.mirror.ln_lower(y, x))
    }
}

/// Logarithms of the probabilities below and above `x`: the smaller side by its own sum.
fn tails(
    [a, b]: [f64; 2],
    [x, y]: [f64; 2],
    below: impl FnOnce() -> f64,
    above: impl FnOnce() -> f64,
) -> (f64, f64) {
    if x <= 0.0 {
        (f64::NEG_INFINITY, 0.0)
    } else if y <= 0.0 {
        (0.0, f64::NEG_INFINITY)
    } else if x * (a + b + 2.0) < a + 1.0 {
        let lower = below().min(0.0);
        (lower, ln_one_minus_exp(lower))
    } else {
        let upper = above().min(0.0);
        (ln_one_minus_exp(upper), upper)
    }
}

/// Logarithm of the density of the beta distribution on (0, 1) at `x`, where `y = 1 - x`.
pub fn ln_beta_density(a: f64, b: f64, x: f64, y: f64) -> f64 {
    Shapes::new(a, b).ln_density(x, y)
}

/// Logarithms of the regularised incomplete beta function `I_x(a, b)` and of its complement, the probabilities below
/// and above `x`, where `y = 1 - x`.
///
/// Continued fraction as in Press et al., Numerical Recipes, section 6.4.
pub fn beta_tails(a: f64, b: f64, x: f64, y: f64) -> (f64, f64) {
    let below = || Shapes::new(a, b).ln_lower(x, y);
    tails([a, b], [x, y], below, || Shapes::new(b, a).ln_lower(y, x))
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
    let both = Mirrored { own: Shapes::new(a, b), mirror: Shapes::new(b, a) };
    let (below, above) = both.tails(0.5, 0.5);
    let left = if p <= q { p.ln() <= below } else { q.ln() >= above };
    if left {
        let x = lower_inverse(&both, p, q);
        (x, 1.0 - x)
    } else {
        let y = lower_inverse(&Mirrored { own: both.mirror, mirror: both.own }, q, p);
        (1.0 - y, y)
    }
}

/// The solution, known to be at most one half, found in its logarithm.
fn lower_inverse(both: &Mirrored, p: f64, q: f64) -> f64 {
    let Shapes { a, b, .. } = both.own;
    let (ln_p, ln_q) = (p.ln(), q.ln());
    let ln_beta = |a: f64, b: f64| libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    let start = (ln_p + a.ln() + ln_beta(a, b)) / a;
    let u = increasing_zero(-700.0, -std::f64::consts::LN_2, start, |u| {
        let x = u.exp();
        let (lower, upper) = both.tails(x, 1.0 - x);
        let ln_slope = both.own.ln_density(x, 1.0 - x) + u;
        if p <= q {
            (lower - ln_p, (ln_slope - lower).exp())
        } else {
            (ln_q - upper, (ln_slope - upper).exp())
        }
    });
    if u <= -699.0 { 0.0 } else { u.exp() }
}
