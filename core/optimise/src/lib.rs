//! Maxima of a log density, and the shape of the density around them.

mod bounded;
mod laplace;
mod linearised;
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
/// A density with a [linearised form](Target::linearised) is climbed by the Gauss-Newton method first. Each start is
/// followed by L-BFGS-B (Byrd, Lu, Nocedal and Zhu 1995) in coordinates scaled by the curvature of the
/// density, or by the bounds and the spread of the starts if there is none, so that unknowns of order 1e6 and 1e-10 can
/// be combined. Points where the density is zero or undefined turn the search back. Starts at such points are dropped:
/// without a start inside the support the result is empty. Maxima closer to each other than a tenth of a standard
/// deviation are merged.
pub fn maximise(target: &dyn Target, starts: &Matrix) -> Vec<Optimum> {
    let regions = regions(target, starts);
    let risen: Vec<Option<Ascended>> = (0..starts.rows())
        .into_par_iter()
        .map(|row| rise(target, starts.row(row), &regions))
        .collect();
    let risen = distinct(risen.into_iter().flatten().collect());
    let polished: Vec<Ascended> =
        risen.into_par_iter().map(|from| polish(target, from, &regions)).collect();
    let bounds = target.bounds();
    distinct(polished).into_iter().map(|ascended| ascended.optimum(&bounds)).collect()
}

/// Points in falling order of the density, without those that an ascent left at a maximum where another one is.
fn distinct(mut found: Vec<Ascended>) -> Vec<Ascended> {
    found.sort_by(|a, b| {
        // Equal values are ordered by their coordinates, so that the result does not depend on the order of the starts.
        let by_point =
            || a.point.iter().zip(&b.point).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
        b.value.total_cmp(&a.value).then_with(|| by_point().unwrap_or(std::cmp::Ordering::Equal))
    });
    let mut distinct: Vec<Ascended> = Vec::new();
    for ascended in found {
        let near = |better: &Ascended| {
            let pairs = better.point.iter().zip(&ascended.point);
            better.is_top
                && pairs.zip(&better.scales).all(|((x, y), scale)| (x - y).abs() <= 0.1 * scale)
        };
        if !(ascended.is_top && distinct.iter().any(near)) {
            distinct.push(ascended);
        }
    }
    distinct
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

/// Point that an ascent has reached, with the density there.
struct Ascended {
    point: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
    /// Standard deviation of each coordinate given the others.
    scales: Vec<f64>,
    /// Evaluations of the density and its gradient since the start.
    evaluations: usize,
    /// False if the ascent has yet to begin.
    is_top: bool,
    /// Gain in log density that the numerical error of the density hides; zero if it hides none.
    hidden: f64,
}

impl Ascended {
    fn gradient_norm(&self, bounds: &[(f64, f64)]) -> f64 {
        gradient_norm(&self.point, &self.gradient, bounds, &self.scales)
    }

    fn optimum(self, bounds: &[(f64, f64)]) -> Optimum {
        let gradient_norm = self.gradient_norm(bounds);
        let converged = gradient_norm <= CONVERGED;
        let Self { point, value, evaluations, .. } = self;
        Optimum { point, value, gradient_norm, converged, evaluations }
    }
}

/// Follows one start upwards by linearised densities, if there are any; `None` if the density is zero at the start.
fn rise(target: &dyn Target, start: &[f64], regions: &[Region]) -> Option<Ascended> {
    let bounds = target.bounds();
    let clamped = start.iter().zip(&bounds).map(|(x, (lo, hi))| x.max(*lo).min(*hi));
    let point: Vec<f64> = clamped.collect();
    if let Some(ascended) = linearised::ascend(target, &point, regions) {
        return Some(ascended);
    }
    let (value, gradient) = target.gradient(&point);
    if !value.is_finite() || gradient.iter().any(|g| !g.is_finite()) {
        return None;
    }
    let scales = laplace::scales(target, &point, regions);
    Some(Ascended { point, value, gradient, scales, evaluations: 1, is_top: false, hidden: 0.0 })
}

/// Follows L-BFGS-B until the gradient is negligible, unless an ascent has made it small already.
fn polish(target: &dyn Target, mut at: Ascended, regions: &[Region]) -> Ascended {
    let bounds = target.bounds();
    if at.is_top && at.gradient_norm(&bounds) <= CONVERGED {
        return at;
    }
    // Smaller gains are those of a random walk in the numerical error.
    let least = at.hidden / at.value.abs().max(1.0);
    let precision = Precision { gain: Some(least.max(f64::EPSILON)), ..FINEST };
    for _ in 0..PASSES {
        let reached =
            Scaled::new(target, &at.point, &at.scales).maximise(at.value, &at.gradient, precision);
        at.evaluations += reached.evaluations;
        let gain = reached.value - at.value;
        if gain >= 0.0 {
            (at.point, at.value, at.gradient) = (reached.point, reached.value, reached.gradient);
        }
        at.scales = laplace::scales(target, &at.point, regions);
        let small = at.gradient_norm(&bounds) < 1e-3 * CONVERGED;
        // Below this gain the rounding of the density hides any further improvement.
        if small || gain <= at.hidden.max(1e-13 * at.value.abs()) {
            break;
        }
    }
    Ascended { is_top: true, ..at }
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
