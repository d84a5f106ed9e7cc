//! The noise of a curve without replicates, from the one record there is.
//!
//! Its size and memory are those of the misfit about what the unknowns of the model can do and about its slow part, by
//! restricted likelihood: what is slow and large by the measure of the noise's own memory is no noise.

use super::autoregression::Autoregression;
use super::slow;
use crate::linalg::vector::{add_scaled, dot};
use crate::linalg::{Matrix, multiply_transposed, symmetric_eigen};

/// What the prior lets the unknowns do to a record counts from this share of its misfit on: squared.
const MATTERS: f64 = 1e-4;

/// Directions of a matrix with smaller eigenvalues, relative to the largest, are round-off.
const ROUND_OFF: f64 = 1e-12;

/// The noise of a record, the standard deviation of its innovations and its memory: of its misfit at these places, where the
/// unknowns can do `slopes`, one a row, by their priors' widths.
pub(super) fn noise(misfit: &[f64], slopes: &Matrix, places: &[usize]) -> (f64, Autoregression) {
    let largest = misfit.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let unknowns = directions(slopes, dot(misfit, misfit) / misfit.len().max(1) as f64);
    let found = slow::law(misfit, &unknowns, places).map(|law| (law.sd, law.memory));
    let (sd, memory) =
        found.unwrap_or_else(|| (between_neighbours(misfit), Autoregression::white()));
    let sd = sd.max(1e-6 * largest);
    (if sd > 0.0 { sd } else { 1.0 }, memory)
}

/// What unknowns can do in as few directions as matter, orthonormal: those along which a width of the priors moves the curve
/// enough.
fn directions(slopes: &Matrix, square: f64) -> Vec<Vec<f64>> {
    let Ok(eigen) = symmetric_eigen(&multiply_transposed(slopes, slopes)) else {
        return Vec::new();
    };
    let largest = eigen.values.iter().copied().fold(0.0, f64::max);
    let enough = (MATTERS * square * slopes.columns() as f64).max(ROUND_OFF * largest);
    let kept = (0..eigen.values.len()).filter(|&k| eigen.values[k] > enough);
    let direction = |k: usize| {
        let mut sum = vec![0.0; slopes.columns()];
        for (j, row) in slopes.iter_rows().enumerate() {
            add_scaled(&mut sum, eigen.vectors[(j, k)] / eigen.values[k].sqrt(), row);
        }
        sum
    };
    kept.map(direction).collect()
}

/// The size of white noise by the differences between neighbours (von Neumann, Annals of Mathematical Statistics 12 (1941)
/// 367), for records that are too short for more.
fn between_neighbours(misfit: &[f64]) -> f64 {
    let squares: f64 = misfit.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    let steps = misfit.len().saturating_sub(1).max(1) as f64;
    (squares / (2.0 * steps)).sqrt()
}
