//! Path to a maximum and the normal approximations along it (Zhang et al. 2022).
//!
//! Where Pathfinder uses L-BFGS, the full BFGS matrix is kept: it takes `d^2` numbers and is the better covariance.
//! It starts with the curvature at the starting point.

use lacuna::math::random::normal;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::Target;
use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Matrix, multiply_vector};
use rand::Rng;

use super::law::Law;
use super::{Fit, Path, Point, Progress};

/// Minimum gain of the quadratic model, in units of log density; a path ends below it.
const LEAST_GAIN: f64 = 1e-6;
/// Gain of a step below which a path ends, too: a density whose model is integrated numerically has no more digits, and
/// draws are corrected by their weights.
const NUMERICAL: f64 = 1e-3;
/// Number of draws to estimate an evidence lower bound.
const DRAWS: usize = 20;
/// Constants of the weak Wolfe conditions: sufficient increase, and decrease of the slope.
const RISE: f64 = 1e-4;
const CURVATURE: f64 = 0.9;
/// Maximum number of points of one line search.
const TRIALS: usize = 40;

/// Makes one step of the path; the flag is true if the path goes on.
pub(super) fn iterate(
    target: &Unconstrained<'_>,
    path: &mut Path,
    rng: &mut impl Rng,
) -> (Progress, bool) {
    let mut evaluations = judge(target, path, rng);
    let direction = multiply_vector(&path.inverse, &path.point.gradient);
    let slope = dot(&path.point.gradient, &direction);
    if slope.is_nan() || 0.5 * slope < LEAST_GAIN {
        return (Progress { moved: false, evaluations }, false);
    }
    let (found, spent) = search(target, &path.point, &direction, slope);
    evaluations += spent;
    let Some(next) = found else { return (Progress { moved: false, evaluations }, false) };
    update(&mut path.inverse, &path.point, &next);
    let moved = next.place != path.point.place;
    let on = next.value - path.point.value >= NUMERICAL;
    path.point = next;
    (Progress { moved, evaluations }, on)
}

/// Keeps the normal approximation at the present point if its evidence lower bound is the largest so far; returns the
/// number of evaluations.
fn judge(target: &Unconstrained<'_>, path: &mut Path, rng: &mut impl Rng) -> u64 {
    let mut mean = path.point.place.clone();
    let shift = multiply_vector(&path.inverse, &path.point.gradient);
    add_scaled(&mut mean, 1.0, &shift);
    let Some(law) = Law::new(mean, &path.inverse) else { return 0 };
    let z = Matrix::from_fn(DRAWS, path.point.place.len(), |_, _| normal(rng));
    let density = target.log_density(&law.points(&z));
    let differences = density.iter().zip(z.iter_rows()).map(|(p, z)| p - law.log_density_of(z));
    let bound = differences.sum::<f64>() / DRAWS as f64;
    if bound.is_finite() && path.best.as_ref().is_none_or(|best| bound > best.bound) {
        path.best = Some(Fit { law, bound });
    }
    DRAWS as u64
}

/// Searches along a direction for a point that satisfies the weak Wolfe conditions, by bisection (Lewis and Overton,
/// Math. Program. 141 (2013) 135), and returns the number of evaluations; `None` if rounding hides the increase.
fn search(
    target: &Unconstrained<'_>,
    from: &Point,
    direction: &[f64],
    slope: f64,
) -> (Option<Point>, u64) {
    let (mut low, mut high, mut t) = (0.0, f64::INFINITY, 1.0);
    let mut best = None;
    for trial in 1..=TRIALS {
        let mut place = from.place.clone();
        add_scaled(&mut place, t, direction);
        let point = Point::at(target, place);
        if point.value >= from.value + RISE * t * slope {
            let flat = dot(&point.gradient, direction) <= CURVATURE * slope;
            best = Some(point);
            if flat {
                return (best, trial as u64);
            }
            low = t;
        } else {
            high = t;
        }
        t = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * low };
    }
    (best, TRIALS as u64)
}

/// Updates the inverse by the formula of Broyden, Fletcher, Goldfarb and Shanno; skipped if the density is not
/// concave along the step, because the matrix would no longer be positive definite.
fn update(inverse: &mut Matrix, from: &Point, to: &Point) {
    let s: Vec<f64> = to.place.iter().zip(&from.place).map(|(b, a)| b - a).collect();
    let y: Vec<f64> = from.gradient.iter().zip(&to.gradient).map(|(a, b)| a - b).collect();
    let curvature = dot(&s, &y);
    let spread = multiply_vector(inverse, &y);
    let scale = dot(&y, &spread);
    if !(curvature > 1e-10 * scale && curvature > 0.0 && scale.is_finite()) {
        return;
    }
    let factor = (1.0 + scale / curvature) / curvature;
    for i in 0..s.len() {
        for j in 0..s.len() {
            inverse[(i, j)] +=
                factor * s[i] * s[j] - (spread[i] * s[j] + s[i] * spread[j]) / curvature;
        }
    }
}
