//! Maxima of a log density, and the shape of the density around them.

mod bounded;
mod laplace;
mod scatter;

use lacuna_base::math::Target;
use lacuna_base::math::random::Stream;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::norm;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use bounded::Scaled;

pub use laplace::{Laplace, laplace};
pub use scatter::{scatter, scatter_without_bounds};

/// A maximum of a log density.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Optimum {
    /// Position of the maximum.
    pub point: Vec<f64>,
    /// Log density at the maximum.
    pub value: f64,
    /// Norm of the gradient, in log density per standard deviation of each coordinate (given the others); coordinates
    /// that are pressed against a bound do not count.
    pub gradient_norm: f64,
    /// True if the gradient is so small that the point is within a thousandth of a standard deviation of a maximum.
    pub converged: bool,
    /// Number of evaluations of density and gradient since the start.
    pub evaluations: usize,
}

/// Gradient norm below which a maximum counts as found.
const CONVERGED: f64 = 1e-3;

/// Stopping criteria of [`ascend`]; the first one met ends the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Precision {
    /// Largest slope of any coordinate, in log density per unit of its scale.
    pub gradient: f64,
    /// Smallest gain of a step, as a fraction of the log density; `None` for no such criterion.
    pub gain: Option<f64>,
    /// Largest number of steps.
    pub steps: u64,
}

/// Limited only by the rounding of the density.
const FINEST: Precision = Precision { gradient: 1e-9, gain: Some(f64::EPSILON), steps: 500 };

/// Largest number of times that the coordinates are rescaled.
const PASSES: usize = 6;

/// The distinct maxima of a log density within its bounds, reached from the rows of `starts` (`starts x dimension`),
/// the largest first.
///
/// Each start is followed by L-BFGS-B (Byrd, Lu, Nocedal and Zhu 1995) in coordinates scaled by the curvature of the
/// density, or by the bounds and the spread of the starts if there is none, so that unknowns of order 1e6 and 1e-10 can
/// be combined. Points where the density is zero or undefined turn the search back. Starts at such points are dropped:
/// without a start inside the support the result is empty. Maxima closer to each other than a tenth of a standard
/// deviation are merged.
pub fn maximise(target: &dyn Target, starts: &Matrix) -> Vec<Optimum> {
    let regions = regions(target, starts);
    let found: Vec<Option<Optimum>> = (0..starts.rows())
        .into_par_iter()
        .map(|row| climb(target, starts.row(row), &regions))
        .collect();
    let mut found: Vec<Optimum> = found.into_iter().flatten().collect();
    found.sort_by(|a, b| {
        // Equal values are ordered by their coordinates, so that the result does not depend on the order of the starts.
        let by_point =
            || a.point.iter().zip(&b.point).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
        b.value.total_cmp(&a.value).then_with(|| by_point().unwrap_or(std::cmp::Ordering::Equal))
    });
    let mut distinct: Vec<(Optimum, Vec<f64>)> = Vec::new();
    for optimum in found {
        let near = |(better, scales): &(Optimum, Vec<f64>)| {
            let pairs = better.point.iter().zip(&optimum.point);
            pairs.zip(scales).all(|((x, y), scale)| (x - y).abs() <= 0.1 * scale)
        };
        if !distinct.iter().any(near) {
            let scales = laplace::scales(target, &optimum.point, &regions);
            distinct.push((optimum, scales));
        }
    }
    distinct.into_iter().map(|(optimum, _)| optimum).collect()
}

/// The maximum of a log density that one search by L-BFGS-B reaches from a start, in coordinates of known scales;
/// `None` if the density is zero or undefined at the start.
///
/// Needs no evaluations besides those of the search: for expensive densities whose coordinates have scales known
/// beforehand, such as logarithms.
pub fn ascend(
    target: &dyn Target,
    start: &[f64],
    scales: &[f64],
    precision: Precision,
) -> Option<Optimum> {
    let bounds = target.bounds();
    let clamped = start.iter().zip(&bounds).map(|(x, (lo, hi))| x.max(*lo).min(*hi));
    let start: Vec<f64> = clamped.collect();
    let (value, gradient) = target.gradient(&start);
    if !value.is_finite() || gradient.iter().any(|g| !g.is_finite()) {
        return None;
    }
    let reached = Scaled::new(target, &start, scales).maximise(value, &gradient, precision);
    let gradient_norm = gradient_norm(&reached.point, &reached.gradient, &bounds, scales);
    Some(Optimum {
        point: reached.point,
        value: reached.value,
        gradient_norm,
        converged: gradient_norm <= CONVERGED.max(precision.gradient),
        evaluations: reached.evaluations + 1,
    })
}

/// Extent of one coordinate.
#[derive(Debug, Clone, Copy)]
struct Region {
    /// Initial scale: the distance between the bounds, otherwise the spread of the prior or of the starts.
    size: f64,
    /// Upper limit of the standard deviation.
    largest: f64,
}

fn regions(target: &dyn Target, starts: &Matrix) -> Vec<Region> {
    // Any fixed stream serves: the draws only give the order of magnitude.
    let prior = target.prior_draws(64, &Stream::root(0).named("region"));
    let spread = |points: &Matrix, j: usize| {
        let column = points.column(j);
        let low = column.iter().copied().fold(f64::INFINITY, f64::min);
        let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        high - low
    };
    let region = |(j, (lo, hi)): (usize, (f64, f64))| {
        let between = hi - lo;
        let largest = if between > 0.0 { between } else { f64::INFINITY };
        let magnitude = starts.column(j).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let size = [between, spread(&prior, j), spread(starts, j), magnitude]
            .into_iter()
            .find(|size| *size > 0.0 && size.is_finite())
            .unwrap_or(1.0);
        Region { size, largest }
    };
    target.bounds().into_iter().enumerate().map(region).collect()
}

/// Follows one start upwards; `None` if the density is zero at the start.
fn climb(target: &dyn Target, start: &[f64], regions: &[Region]) -> Option<Optimum> {
    let bounds = target.bounds();
    let clamped = start.iter().zip(&bounds).map(|(x, (lo, hi))| x.max(*lo).min(*hi));
    let mut point: Vec<f64> = clamped.collect();
    let (mut value, mut gradient) = target.gradient(&point);
    let mut evaluations = 1;
    if !value.is_finite() || gradient.iter().any(|g| !g.is_finite()) {
        return None;
    }
    let mut scales = laplace::scales(target, &point, regions);
    for _ in 0..PASSES {
        let reached = Scaled::new(target, &point, &scales).maximise(value, &gradient, FINEST);
        evaluations += reached.evaluations;
        let gain = reached.value - value;
        if gain >= 0.0 {
            (point, value, gradient) = (reached.point, reached.value, reached.gradient);
        }
        scales = laplace::scales(target, &point, regions);
        let small = gradient_norm(&point, &gradient, &bounds, &scales) < 1e-3 * CONVERGED;
        // Below this gain the rounding of the density hides any further improvement.
        if small || gain <= 1e-13 * value.abs() {
            break;
        }
    }
    let gradient_norm = gradient_norm(&point, &gradient, &bounds, &scales);
    let converged = gradient_norm <= CONVERGED;
    Some(Optimum { point, value, gradient_norm, converged, evaluations })
}

/// Norm of the scaled gradient without the components that press against a bound.
fn gradient_norm(x: &[f64], gradient: &[f64], bounds: &[(f64, f64)], scales: &[f64]) -> f64 {
    let free = |j: usize| {
        let (lo, hi) = bounds[j];
        let pressed = (x[j] <= lo && gradient[j] < 0.0) || (x[j] >= hi && gradient[j] > 0.0);
        if pressed { 0.0 } else { gradient[j] * scales[j] }
    };
    norm(&(0..x.len()).map(free).collect::<Vec<_>>())
}

#[cfg(test)]
mod corners;
#[cfg(test)]
mod tests;
