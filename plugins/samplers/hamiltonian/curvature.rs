//! Initial covariance of a density before any draw: its curvature at the starting points.

use lacuna::math::moments::{mean, quantile, sorted};
use lacuna::math::random::Stream;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::Target;
use lacuna_linalg::{Cholesky, Matrix, symmetric_eigen};
use rayon::prelude::*;

/// Initial covariance (`d x d`, free coordinates) and the number of gradients it took.
pub(crate) struct Curvature {
    pub covariance: Matrix,
    pub gradients: u64,
}

/// Maximum number of starting points at which the curvature is computed.
const MOST_PLACES: usize = 8;
/// Number of prior draws from which the prior's width is estimated.
const PRIOR_DRAWS: usize = 100;
/// Step of the central differences, in standard deviations.
const STEP: f64 = 1e-3;

/// Returns the inverse of the mean curvature at `places`, with the absolute values of its eigenvalues, plus the
/// inverse prior variance of each coordinate.
///
/// At draws around a maximum this is the Laplace approximation, in any units. Far from a maximum the scales are
/// rough; no scale is wider than the prior's.
pub(crate) fn covariance(target: &Unconstrained<'_>, places: &[&[f64]]) -> Curvature {
    let d = target.dimension();
    let widths = widths(target, places);
    let (mut sum, mut count, mut gradients) = (Matrix::zeros(d, d), 0.0, 0);
    let some = &places[..places.len().min(MOST_PLACES)];
    let found: Vec<_> = some.par_iter().map(|place| at(target, place, &widths)).collect();
    for (curvature, spent) in found {
        gradients += spent;
        if let Some(curvature) = curvature {
            count += 1.0;
            for (sum, entry) in sum.as_mut_slice().iter_mut().zip(curvature.as_slice()) {
                *sum += entry;
            }
        }
    }
    sum.as_mut_slice().iter_mut().for_each(|entry| *entry /= f64::max(count, 1.0));
    let scaled = inverse(&sum);
    let covariance = Matrix::from_fn(d, d, |i, j| widths[i] * widths[j] * scaled[(i, j)]);
    Curvature { covariance, gradients }
}

/// Returns half the prior's width in each free coordinate; that of the starting points if the prior has none.
fn widths(target: &Unconstrained<'_>, places: &[&[f64]]) -> Vec<f64> {
    // The draws only tell the order of magnitude, so that a fixed stream is sufficient.
    let prior = target.prior_draws(PRIOR_DRAWS, &Stream::root(0).named("width"));
    let half = |values: &[f64]| {
        let finite: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
        let ordered = sorted(&finite);
        0.5 * (quantile(&ordered, 0.84) - quantile(&ordered, 0.16))
    };
    (0..target.dimension())
        .map(|j| {
            let starts: Vec<f64> = places.iter().map(|p| p[j]).collect();
            [half(&prior.column(j)), half(&starts), mean(&starts).abs()]
                .into_iter()
                .find(|width| *width > 0.0 && width.is_finite())
                .unwrap_or(1.0)
        })
        .collect()
}

/// Inverts a curvature given in units of the prior's widths.
fn inverse(curvature: &Matrix) -> Matrix {
    let d = curvature.rows();
    // Each coordinate is scaled by its own curvature, so that small eigenvalues keep their digits.
    let own: Vec<f64> = (0..d).map(|j| curvature[(j, j)].abs().max(1.0).sqrt().recip()).collect();
    let scaled = Matrix::from_fn(d, d, |i, j| own[i] * own[j] * curvature[(i, j)]);
    let diagonal = || Matrix::from_fn(d, d, |i, j| if i == j { own[i] * own[i] } else { 0.0 });
    let Ok(eigen) = symmetric_eigen(&scaled) else { return diagonal() };
    let precision = Matrix::from_fn(d, d, |i, j| {
        let sum: f64 = (0..d)
            .map(|k| eigen.vectors[(i, k)] * eigen.values[k].abs() * eigen.vectors[(j, k)])
            .sum();
        sum + if i == j { own[i] * own[i] } else { 0.0 }
    });
    let Ok(cholesky) = Cholesky::new(&precision) else { return diagonal() };
    let inverse = cholesky.inverse();
    Matrix::from_fn(d, d, |i, j| own[i] * own[j] * inverse[(i, j)])
}

/// Returns the negative second derivatives of the log density at `place` in units of `widths`, and the number of
/// gradients used; `None` if some of them cannot be computed.
fn at(target: &Unconstrained<'_>, place: &[f64], widths: &[f64]) -> (Option<Matrix>, u64) {
    let d = place.len();
    let mut curvature = Matrix::zeros(d, d);
    let mut gradients = 0;
    for j in 0..d {
        // The step is adapted to the scale of the curvature that it measures.
        let mut step = STEP;
        let mut column = None;
        for _ in 0..20 {
            let found = difference(target, place, widths, j, step);
            gradients += 2;
            let Some(found) = found else {
                step *= 0.1;
                continue;
            };
            let scale = found[j].abs().sqrt().max(1.0).recip();
            column = Some(found);
            if step <= 10.0 * STEP * scale {
                break;
            }
            step = STEP * scale;
        }
        let Some(column) = column else { return (None, gradients) };
        (0..d).for_each(|i| curvature[(i, j)] = column[i]);
    }
    let symmetric = Matrix::from_fn(d, d, |i, j| 0.5 * (curvature[(i, j)] + curvature[(j, i)]));
    (Some(symmetric), gradients)
}

fn difference(
    target: &Unconstrained<'_>,
    place: &[f64],
    widths: &[f64],
    j: usize,
    step: f64,
) -> Option<Vec<f64>> {
    let at = |h: f64| {
        let mut moved = place.to_vec();
        moved[j] += h * widths[j];
        let (value, gradient) = target.gradient(&moved);
        value.is_finite().then_some((moved[j], gradient))
    };
    let ((left, below), (right, above)) = (at(-step)?, at(step)?);
    let distance = (right - left) / widths[j];
    if distance <= 0.0 {
        return None;
    }
    let slopes = below.iter().zip(&above).zip(widths);
    Some(slopes.map(|((b, a), width)| (b - a) * width / distance).collect())
}
