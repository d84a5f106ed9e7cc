//! Laplace approximation: the normal distribution with the curvature of a log density at its maximum.

use lacuna_base::math::Target;
use lacuna_base::run::Stop;
use lacuna_linalg::{Matrix, multiply_transposed, symmetric_eigen};
use serde::{Deserialize, Serialize};

use crate::Region;

/// Step of the finite differences, in standard deviations: large enough for a gradient with nine digits.
const STEP: f64 = 1e-3;

/// Smallest curvature, relative to that of each coordinate alone, that is not treated as zero.
const FLATTEST: f64 = 1e-8;

/// Normal approximation of a density around its maximum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Laplace {
    /// Covariance, `dimension x dimension`.
    pub covariance: Matrix,
    /// A factor `F` with `covariance = F F'`.
    pub factor: Matrix,
    /// True if the density decreases in all directions. In a direction in which it does not, the standard deviation is
    /// the width of the bounds or a thousand times that of the other coordinates, instead of infinite.
    pub definite: bool,
}

/// Inverse of the curvature at a maximum, from central differences of the gradient.
///
/// Steps are a thousandth of the standard deviation that the curvature itself implies; at a bound they are one-sided. A
/// coordinate that is pressed against its bound with slope `g` is treated as exponential, with variance `1 / g^2`.
pub fn laplace(target: &dyn Target, maximum: &[f64]) -> Result<Laplace, Stop> {
    let start = Matrix::from_rows(maximum.len(), [maximum]);
    let regions = super::regions(target, &start);
    let pressure = pressure(target, maximum);
    let curved = scales(target, maximum, &regions);
    // Precisions add: that of the curvature, and that of the exponential fall from a bound.
    let scales: Vec<f64> =
        curved.iter().zip(&pressure).map(|(s, p)| 1.0 / (1.0 / (s * s) + p).sqrt()).collect();
    let d = maximum.len();
    let mut curvature = Matrix::zeros(d, d);
    let mut definite = true;
    for j in 0..d {
        let step = STEP * scales[j];
        let column = if flat(target, maximum, j, curved[j], regions[j]) {
            None
        } else {
            slope_of_gradient(target, maximum, j, step)
        };
        if let Some(column) = column {
            (0..d).for_each(|i| curvature[(i, j)] = -column[i] * scales[i] * scales[j]);
        } else if pressure[j] == 0.0 {
            definite = false;
            curvature[(j, j)] = 1.0;
        }
        curvature[(j, j)] += pressure[j] * scales[j] * scales[j];
    }
    // Differences along different coordinates have different errors, so the matrix is symmetric only after averaging.
    let symmetric = Matrix::from_fn(d, d, |i, j| 0.5 * (curvature[(i, j)] + curvature[(j, i)]));
    let eigen = symmetric_eigen(&symmetric)
        .map_err(|error| Stop::new(format!("the curvature at the maximum is unusable: {error}")))?;
    let largest = eigen.values.iter().copied().fold(0.0, f64::max);
    definite &= eigen.values.iter().all(|value| *value > FLATTEST * largest);
    // In scaled coordinates a curvature of 1e-6 is a standard deviation a thousand times that of the coordinates.
    let floor = if definite { 0.0 } else { 1e-6 };
    let factor = Matrix::from_fn(d, d, |i, k| {
        scales[i] * eigen.vectors[(i, k)] / eigen.values[k].max(floor).sqrt()
    });
    Ok(Laplace { covariance: multiply_transposed(&factor, &factor), factor, definite })
}

/// Squared gradient of each coordinate that is pressed against a bound; zero for the others.
fn pressure(target: &dyn Target, maximum: &[f64]) -> Vec<f64> {
    let (_, gradient) = target.gradient(maximum);
    let pressed = |((x, g), (lo, hi)): ((&f64, &f64), (f64, f64))| {
        if (*x <= lo && *g < 0.0) || (*x >= hi && *g > 0.0) { g * g } else { 0.0 }
    };
    maximum.iter().zip(&gradient).zip(target.bounds()).map(pressed).collect()
}

/// Standard deviation of each coordinate given the others, from the curvature; the size of its region if the density
/// does not curve downwards.
pub(super) fn scales(target: &dyn Target, x: &[f64], regions: &[Region]) -> Vec<f64> {
    (0..x.len()).map(|j| scale(target, x, j, regions[j])).collect()
}

fn scale(target: &dyn Target, x: &[f64], j: usize, region: Region) -> f64 {
    // The step must match the scale that it measures: start from the size of the region and iterate.
    let mut step = STEP * region.size;
    let mut found = region.size;
    for _ in 0..30 {
        let curvature = slope_of_gradient(target, x, j, step).map(|slopes| -slopes[j]);
        match curvature {
            Some(curvature) if curvature > 0.0 => {
                let scale = 1.0 / curvature.sqrt();
                found = scale.min(region.largest);
                if (10.0 * step..=1e5 * step).contains(&scale) || scale >= region.largest {
                    break;
                }
                step = STEP * found;
            }
            // No density, or convex: the step may have left the peak.
            _ => step *= 0.1,
        }
        if step < 1e-14 * region.size.min(found) {
            break;
        }
    }
    found
}

/// Returns true if coordinate `j` has no downward curvature, so that its scale is that of its region.
fn flat(target: &dyn Target, x: &[f64], j: usize, scale: f64, region: Region) -> bool {
    scale >= region.size.min(region.largest)
        && slope_of_gradient(target, x, j, STEP * scale)
            .is_none_or(|slopes| -slopes[j] * scale * scale < FLATTEST)
}

/// Change of the gradient along coordinate `j`, per unit; `None` if the density or its gradient is undefined.
fn slope_of_gradient(target: &dyn Target, x: &[f64], j: usize, step: f64) -> Option<Vec<f64>> {
    let (lo, hi) = target.bounds()[j];
    let at = |place: f64| {
        let mut point = x.to_vec();
        point[j] = place;
        let (value, gradient) = target.gradient(&point);
        (value.is_finite() && gradient.iter().all(|g| g.is_finite())).then_some(gradient)
    };
    let (left, right) = ((x[j] - step).max(lo), (x[j] + step).min(hi));
    if right <= left {
        return None;
    }
    let (below, above) = (at(left)?, at(right)?);
    Some(below.iter().zip(above).map(|(b, a)| (a - b) / (right - left)).collect())
}
