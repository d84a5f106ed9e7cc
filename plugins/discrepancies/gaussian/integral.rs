//! An unknown variance integrated out.
//!
//! The integral over the variance of likelihood times prior is computed in `u = log v`, in which the integrand is
//! smooth and decays on both sides: Gauss-Legendre quadrature with ten points on panels from the maximum outwards,
//! each wider than the one before, until they contribute nothing.

use lacuna::math::distribution::Distribution;
use lacuna::math::special::ln_gamma;

use super::statistics::{Residual, Spread};

/// The posterior of the variance, as a discrete distribution.
pub(super) struct Integral {
    /// Logarithm of the integral.
    pub log: f64,
    /// Grid of variances and their probabilities.
    pub nodes: Vec<(f64, f64)>,
}

/// Nodes and weights on (0, 1) of the rule on (-1, 1) (Abramowitz and Stegun 25.4.30).
const RULE: [(f64, f64); 5] = [
    (0.148_874_338_981_631, 0.295_524_224_714_753),
    (0.433_395_394_129_247, 0.269_266_719_309_996),
    (0.679_409_568_299_024, 0.219_086_362_515_982),
    (0.865_063_366_688_985, 0.149_451_349_150_581),
    (0.973_906_528_517_172, 0.066_671_344_308_688),
];

/// Ratio of the widths of a panel and its neighbour nearer to the maximum.
const GROWTH: f64 = 1.15;
/// Maximum number of panels on one side; only densities that do not decay need more.
const PANELS: usize = 400;

/// Returns the log of the integral in closed form, for an inverse gamma prior without common errors (conjugate to
/// independent normal data); `None` otherwise.
pub(super) fn conjugate(spread: &Spread, outside: f64, prior: &Distribution) -> Option<f64> {
    let Distribution::InverseGamma([shape, scale]) = *prior else { return None };
    if !spread.eigenvalues.is_empty() {
        return None;
    }
    let (a, b) = (shape + 0.5 * spread.count, scale + 0.5 * (spread.scatter + outside));
    let own = spread.count * std::f64::consts::TAU.ln() + spread.log_scale;
    Some(shape * scale.ln() - ln_gamma(shape) + ln_gamma(a) - a * b.ln() - 0.5 * own)
}

/// Computes the integral and the posterior of the variance.
pub(super) fn integrate(spread: &Spread, residual: Residual<'_>, prior: &Distribution) -> Integral {
    let (low, high) = prior.support();
    // At the ends of the support, rounding in the logarithm and back may lead outside it.
    let variance = |u: f64| u.exp().clamp(low.max(f64::MIN_POSITIVE), high);
    let density = |u: f64| {
        let v = variance(u);
        spread.log_likelihood(v, residual) + prior.log_density(v) + u
    };
    let median = prior.quantile(0.5);
    let slope = |u: f64| {
        let v = variance(u);
        if prior.log_density(v) == f64::NEG_INFINITY {
            return if v > median { -1.0 } else { 1.0 };
        }
        (spread.by_variance(v, residual) + prior.log_density_derivative(v)) * v + 1.0
    };
    let bounds = (low.max(0.0).ln().max(-690.0), high.ln().min(690.0));
    let squares = residual.along.iter().map(|a| a * a).sum::<f64>();
    let estimate = (spread.scatter + residual.outside + squares) / spread.count;
    let top = summit(slope, estimate.max(f64::MIN_POSITIVE).ln(), bounds);
    let highest = density(top);
    if !highest.is_finite() {
        return Integral { log: f64::NEG_INFINITY, nodes: Vec::new() };
    }
    let step = 1e-4 * (2.0 / spread.count).sqrt();
    let (before, after) = ((top - step).max(bounds.0), (top + step).min(bounds.1));
    let curvature = (slope(before) - slope(after)) / (after - before);
    let width = 1.5 / (curvature.max(0.0).sqrt() + slope(top).abs() + 0.2);
    let mut nodes = Vec::new();
    let mut total = 0.0;
    // A prior with a corner is integrated separately on its two sides, because the rule needs a smooth integrand.
    let corner = match *prior {
        Distribution::Triangular([_, mode, _]) if mode > 0.0 => Some(mode.ln()),
        _ => None,
    };
    for direction in [1.0, -1.0] {
        let end = if direction > 0.0 { bounds.1 } else { bounds.0 };
        let (mut from, mut width) = (top, width);
        for _ in 0..PANELS {
            if (end - from) * direction <= 0.0 {
                break;
            }
            let mut to = if (end - from).abs() < width { end } else { from + direction * width };
            if let Some(c) = corner.filter(|c| (c - from) * direction > 0.0) {
                to = if (to - c) * direction > 0.0 { c } else { to };
            }
            let added = panel(&density, highest, from, to, &mut nodes);
            total += added;
            if added <= 1e-17 * total {
                break;
            }
            (from, width) = (to, width * GROWTH);
        }
    }
    for (_, p) in &mut nodes {
        *p /= total;
    }
    Integral { log: highest + total.ln(), nodes }
}

/// Adds the nodes of one panel; returns their sum.
fn panel(
    density: &impl Fn(f64) -> f64,
    highest: f64,
    from: f64,
    to: f64,
    nodes: &mut Vec<(f64, f64)>,
) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from).abs());
    let mut sum = 0.0;
    for (x, weight) in RULE {
        for u in [middle - half * x, middle + half * x] {
            let p = half * weight * (density(u) - highest).exp();
            if p > 0.0 {
                nodes.push((u.exp(), p));
                sum += p;
            }
        }
    }
    sum
}

/// Returns the point where a slope changes from positive to negative, or the bound that it points to.
fn summit(slope: impl Fn(f64) -> f64, start: f64, (low, high): (f64, f64)) -> f64 {
    let start = start.clamp(low, high);
    let first = slope(start);
    let direction = if first > 0.0 { 1.0 } else { -1.0 };
    let (mut near, mut step) = (start, 0.125);
    let mut far = start;
    while (slope(far) > 0.0) == (first > 0.0) {
        near = far;
        if far == low && direction < 0.0 || far == high && direction > 0.0 {
            return far;
        }
        far = (far + direction * step).clamp(low, high);
        step *= 2.0;
    }
    let (mut a, mut b) = (near, far);
    let (mut fa, mut fb) = (slope(a), slope(b));
    // Regula falsi with a bisection at every third step. Six digits suffice, because the result only places the
    // panels.
    for k in 0..60 {
        if (b - a).abs() < 1e-6 {
            break;
        }
        let secant = a - fa * (b - a) / (fb - fa);
        let middle = 0.5 * (a + b);
        let inside = (secant - a) * (secant - b) < 0.0 && k % 3 != 2;
        let c = if inside { secant } else { middle };
        let fc = slope(c);
        if (fc > 0.0) == (fa > 0.0) {
            (a, fa) = (c, fc);
        } else {
            (b, fb) = (c, fc);
        }
        if fc == 0.0 {
            return c;
        }
    }
    0.5 * (a + b)
}
