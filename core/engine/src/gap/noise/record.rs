//! The noise of a curve without replicates, from its single record.
//!
//! Its size and autocorrelation are restricted maximum likelihood estimates from the misfit, with the slopes of the
//! model's unknowns and the slow part of the record as fixed effects: a slow component that is large compared with such
//! noise is not noise.

use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Matrix, multiply_transposed, symmetric_eigen};

use super::autoregression::Autoregression;
use super::restricted::Known;
use super::slow;

/// Directions in which a prior width of the unknowns changes the record by less than this share of its mean square
/// misfit are neglected.
const MATTERS: f64 = 1e-4;

/// Directions of a matrix with smaller eigenvalues, relative to the largest, are round-off.
const ROUND_OFF: f64 = 1e-12;

/// The noise of a record from its misfit at these places: the standard deviation of its innovations, and its memory.
/// `slopes`, `unknowns x places`, are the changes by the unknowns in units of the priors' widths.
pub(super) fn noise(
    misfit: &[f64],
    slopes: &Matrix,
    places: &[usize],
    known: &Known,
) -> (f64, Autoregression) {
    let largest = misfit.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let unknowns = directions(slopes, dot(misfit, misfit) / misfit.len().max(1) as f64);
    let found = slow::law(misfit, &unknowns, places, known).map(|law| (law.sd, law.memory));
    let short = || {
        let memory = known.memory.clone().unwrap_or_else(Autoregression::white);
        let sd = known.size.map(|size| size / memory.variance().sqrt());
        (sd.unwrap_or_else(|| between_neighbours(misfit)), memory)
    };
    let (sd, memory) = found.unwrap_or_else(short);
    if known.size.is_some() {
        return (sd, memory);
    }
    let sd = sd.max(1e-6 * largest);
    (if sd > 0.0 { sd } else { 1.0 }, memory)
}

/// Orthonormal directions, `directions x places`, in which a width of the priors moves the curve enough to matter.
fn directions(slopes: &Matrix, square: f64) -> Vec<Vec<f64>> {
    if slopes.rows() == 0 {
        return Vec::new();
    }
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

/// The standard deviation of white noise from the differences between neighbours (von Neumann, Annals of Mathematical
/// Statistics 12 (1941) 367), for records that are too short for an autoregression.
fn between_neighbours(misfit: &[f64]) -> f64 {
    let squares: f64 = misfit.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    let steps = misfit.len().saturating_sub(1).max(1) as f64;
    (squares / (2.0 * steps)).sqrt()
}
