//! The best fit of a system to the replicates' means: largest posterior density under known noise.
//!
//! Levenberg and Marquardt's method on whitened residuals with rows for the prior (Nocedal and Wright, Numerical
//! Optimization, 2nd ed., section 10.3), inside the bounds of the priors.
//!
//! An unknown with a log-uniform prior is searched in its logarithm, where the prior is flat: in the unknown itself the
//! density grows as `1/x` toward the lower bound, and one step in units of the prior's width ends at a bound.

use lacuna::math::distribution::Distribution;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, gram, multiply_vector};

use super::whitener::Whitener;
use super::{Linearised, System};

/// Largest number of steps of a fit.
const STEPS: usize = 40;

/// Smallest gain in log density at which the fit continues.
const GAIN: f64 = 1e-5;

/// The best fit from one start.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The unknowns, with the response and its derivatives there.
    pub at: Linearised,
    /// The whitened residual of the means, one value per output, before projection onto the complement of the slopes.
    pub residual: Vec<f64>,
    /// The whitened derivatives, `unknowns x outputs`, per unit of each unknown.
    pub slopes: Matrix,
    /// The curvature of minus the log density of each prior there.
    pub prior_curvature: Vec<f64>,
    /// Lower bound of the precision that each prior adds: that of its width, so that an unknown which the data do not
    /// determine is not wider than its prior.
    pub prior_precision: Vec<f64>,
    /// `-|residual|^2 / 2` plus the log prior density: the log posterior density up to a constant that depends on the
    /// noise only.
    pub log_density: f64,
    /// The log prior density.
    pub log_prior: f64,
}

impl Fit {
    /// Half the sum of squares: minus the log-likelihood.
    pub fn misfit(&self) -> f64 {
        self.log_prior - self.log_density
    }

    /// The matrix of second derivatives of minus the log density, in the Gauss-Newton approximation.
    fn hessian(&self) -> Matrix {
        let mut hessian = gram(&self.slopes.transposed());
        for (j, p) in self.prior_curvature.iter().enumerate() {
            hessian[(j, j)] += p;
        }
        hessian
    }

    /// The precision matrix of the normal approximation to the posterior, `unknowns x unknowns`, in the inverse units
    /// of the unknowns.
    pub fn precision(&self) -> Matrix {
        let mut precision = self.hessian();
        let least = self.prior_precision.iter().zip(&self.prior_curvature);
        for (j, (least, curvature)) in least.enumerate() {
            precision[(j, j)] += (least - curvature).max(0.0);
        }
        precision
    }

    /// The standard deviation of each unknown by the normal approximation, in its unit.
    pub fn sd(&self) -> Vec<f64> {
        let (scaled, scale) = equilibrated(&self.precision());
        match Cholesky::new(&scaled) {
            Ok(factor) => {
                let inverse = factor.inverse();
                scale.iter().enumerate().map(|(j, s)| s * inverse[(j, j)].sqrt()).collect()
            }
            Err(_) => vec![f64::INFINITY; scale.len()],
        }
    }

    /// The log evidence by Laplace's method, up to the determinant of the noise. The normal density is integrated over
    /// all values, also beyond a bound of the prior.
    pub fn log_evidence(&self) -> f64 {
        let (scaled, scale) = equilibrated(&self.precision());
        let Ok(factor) = Cholesky::new(&scaled) else { return f64::NEG_INFINITY };
        let log_scale: f64 = scale.iter().map(|s| s.ln()).sum();
        let half = 0.5 * scale.len() as f64 * std::f64::consts::TAU.ln();
        self.log_density + half + log_scale - 0.5 * factor.log_determinant()
    }
}

/// A matrix scaled to a unit diagonal, with the scale factors.
fn equilibrated(a: &Matrix) -> (Matrix, Vec<f64>) {
    let scale: Vec<f64> =
        (0..a.rows()).map(|j| 1.0 / a[(j, j)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let scaled = Matrix::from_fn(a.rows(), a.rows(), |i, j| scale[i] * a[(i, j)] * scale[j]);
    (scaled, scale)
}

/// The precision of a normal distribution with the standard deviation of a prior, in the inverse square of the
/// unknown's unit.
pub fn precision(prior: &Distribution) -> f64 {
    let sd = prior.sd();
    let sd = if sd.is_finite() && sd > 0.0 {
        sd
    } else {
        0.25 * (prior.quantile(0.975) - prior.quantile(0.025))
    };
    1.0 / (sd * sd)
}

/// The curvature of minus the log density of a prior at a point; zero if it is negative.
fn curvature(prior: &Distribution, x: f64) -> f64 {
    let (low, high) = prior.support();
    let step = 1e-4 / precision(prior).sqrt();
    let (a, b) = ((x - step).max(low), (x + step).min(high));
    let (left, right) = (prior.log_density_derivative(a), prior.log_density_derivative(b));
    let curvature = (left - right) / (b - a);
    if curvature.is_finite() { curvature.max(0.0) } else { 0.0 }
}

/// Returns true if an unknown is searched in its logarithm.
fn in_logarithm(prior: &Distribution) -> bool {
    matches!(prior, Distribution::LogUniform(_))
}

/// The width of a prior in the coordinate in which its unknown is searched.
fn width(prior: &Distribution) -> f64 {
    match *prior {
        // The standard deviation of the uniform logarithm.
        Distribution::LogUniform([low, high]) => (high.ln() - low.ln()) / 12.0_f64.sqrt(),
        _ => 1.0 / precision(prior).sqrt(),
    }
}

/// The log of the derivatives of the unknowns by the coordinates in which they are searched.
fn log_slope(priors: &[Distribution], point: &[f64]) -> f64 {
    let searched = priors.iter().zip(point).filter(|(prior, _)| in_logarithm(prior));
    searched.map(|(_, x)| x.ln()).sum()
}

/// The fit of largest posterior density to the means (one per output, in the response's unit), from a start in the
/// unknowns' units. The density is that of the searched coordinates: the logarithm for log-uniform priors.
pub fn fit(system: &System<'_>, whitener: &Whitener, means: &[f64], start: &[f64]) -> Fit {
    let bounds = inner(&system.bounds(), system.priors());
    let start: Vec<f64> =
        start.iter().zip(&bounds).map(|(x, (low, high))| x.clamp(*low, *high)).collect();
    let mut best = at(system, whitener, means, &start);
    let merit = |log_density: f64, point: &[f64]| log_density + log_slope(system.priors(), point);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let mut improved = None;
        // A step that does not improve is repeated with more damping: shorter, and closer to the gradient.
        for _ in 0..8 {
            let point = step(system, &best, damping, &bounds);
            if point == best.at.point {
                break;
            }
            let density = log_density(system, whitener, means, &point);
            if merit(density, &point) > merit(best.log_density, &best.at.point) {
                improved = Some(point);
                break;
            }
            damping = (damping * 8.0).max(1e-8);
        }
        let Some(point) = improved else { break };
        damping = (damping * 0.1).max(1e-12);
        let next = at(system, whitener, means, &point);
        let gain =
            merit(next.log_density, &next.at.point) - merit(best.log_density, &best.at.point);
        best = next;
        if gain < GAIN {
            break;
        }
    }
    best
}

/// The fit of largest log density from several starts; the first one if several are equal.
pub fn fit_from(
    system: &System<'_>,
    whitener: &Whitener,
    means: &[f64],
    starts: &[Vec<f64>],
) -> Option<Fit> {
    let fits = starts.iter().map(|start| fit(system, whitener, means, start));
    let merit = |fit: &Fit| fit.log_density + log_slope(system.priors(), &fit.at.point);
    fits.filter(|fit| fit.log_density.is_finite())
        .reduce(|best, next| if merit(&next) > merit(&best) + GAIN { next } else { best })
}

/// Bounds slightly inside those of the priors, where densities are finite.
fn inner(bounds: &[(f64, f64)], priors: &[Distribution]) -> Vec<(f64, f64)> {
    let inset = |(&(low, high), prior): (&(f64, f64), &Distribution)| {
        let width = high - low;
        if in_logarithm(prior) {
            // A share of the width would cut off decades of a log-uniform prior.
            (low * (1.0 + 1e-9), high * (1.0 - 1e-9))
        } else if width.is_finite() {
            (low + 1e-9 * width, high - 1e-9 * width)
        } else {
            (low, high)
        }
    };
    bounds.iter().zip(priors).map(inset).collect()
}

fn residual(means: &[f64], response: &[f64]) -> Vec<f64> {
    means.iter().zip(response).map(|(y, m)| y - m).collect()
}

fn log_density(system: &System<'_>, whitener: &Whitener, means: &[f64], point: &[f64]) -> f64 {
    let response = system.response(point);
    if response.iter().any(|y| !y.is_finite()) {
        return f64::NEG_INFINITY;
    }
    let z = whitener.whiten(&residual(means, &response));
    -0.5 * dot(&z, &z) + system.log_prior(point)
}

/// The quantities of a fit at a given point, without any step.
pub fn at(system: &System<'_>, whitener: &Whitener, means: &[f64], point: &[f64]) -> Fit {
    let at = system.linearised(point);
    let residual = whitener.whiten(&residual(means, &at.response));
    let log_prior = system.log_prior(point);
    let finite = at.response.iter().all(|y| y.is_finite());
    let log_density =
        if finite { log_prior - 0.5 * dot(&residual, &residual) } else { f64::NEG_INFINITY };
    let priors = system.priors();
    let prior_curvature = priors.iter().zip(point).map(|(p, &x)| curvature(p, x)).collect();
    // The width of a log-uniform prior is that of the logarithm, whatever the size of the unknown.
    let own_precision = |(prior, x): (&Distribution, &f64)| {
        if in_logarithm(prior) { (x * width(prior)).powi(-2) } else { precision(prior) }
    };
    let prior_precision = priors.iter().zip(point).map(own_precision).collect();
    let slopes = whitener.whiten_rows(&at.tangents);
    Fit { at, residual, slopes, prior_curvature, prior_precision, log_density, log_prior }
}

/// The next point: a damped Gauss-Newton step in units of the priors' widths, along the free unknowns. An unknown that
/// is searched in its logarithm moves by at most one width of its prior.
fn step(system: &System<'_>, here: &Fit, damping: f64, bounds: &[(f64, f64)]) -> Vec<f64> {
    let point = &here.at.point;
    let priors = system.priors();
    let mut gradient = multiply_vector(&here.slopes, &here.residual);
    for (g, (prior, &x)) in gradient.iter_mut().zip(priors.iter().zip(point)) {
        // The slope of a flat prior in the logarithm is none: `-1/x`, and `1/x` of the logarithm's own slope.
        *g += if in_logarithm(prior) { 0.0 } else { prior.log_density_derivative(x) };
    }
    let blocked = |j: usize| {
        let (low, high) = bounds[j];
        (point[j] <= low && gradient[j] < 0.0) || (point[j] >= high && gradient[j] > 0.0)
    };
    let free: Vec<usize> = (0..point.len()).filter(|&j| !blocked(j)).collect();
    let hessian = here.hessian();
    // The change of each unknown per width of its prior.
    let unit: Vec<f64> = priors
        .iter()
        .zip(point)
        .map(|(prior, x)| width(prior) * if in_logarithm(prior) { *x } else { 1.0 })
        .collect();
    let reduced = Matrix::from_fn(free.len(), free.len(), |a, b| {
        let (i, j) = (free[a], free[b]);
        let value = unit[i] * hessian[(i, j)] * unit[j];
        if a == b { value * (1.0 + damping) + 1e-12 + damping } else { value }
    });
    // Without a Cholesky factor there is no step, and the fit ends at the present point.
    let Ok(factor) = Cholesky::new(&reduced) else { return point.clone() };
    let mut shift: Vec<f64> = free.iter().map(|&j| gradient[j] * unit[j]).collect();
    factor.solve(&mut shift);
    let mut next = point.clone();
    for (&j, s) in free.iter().zip(&shift) {
        let moved = if in_logarithm(&priors[j]) {
            point[j] * (s.clamp(-1.0, 1.0) * width(&priors[j])).exp()
        } else {
            point[j] + s * unit[j]
        };
        next[j] = moved.clamp(bounds[j].0, bounds[j].1);
    }
    next
}
