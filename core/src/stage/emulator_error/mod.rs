//! The error of the emulator as a covariance of the mean curve, of a size at which calibrations hold.
//!
//! The covariance is estimated from error curves `e_i` at runs that the emulator had not seen ([`Curves`]), in three steps:
//!
//! - their **size** `s(x)` relative to the mean, where the emulator or the number of runs tells it ([`size`]); the
//!   covariance has the mean square size over where the data put the parameters ([`pilot`]);
//! - the **shape** `S` of `e_i / s_i`: few curves span few directions, and a covariance that knows no others lets the data
//!   be fitted in all the rest as if the emulator were exact there. So correlations at a distance are damped
//!   (covariance taper: Houtekamer and Mitchell, Monthly Weather Review 129 (2001) 123; [`taper`]);
//! - a **factor**: generalised least squares finds the directions in which a covariance understates the error, whatever its
//!   shape. So each run is taken for the truth and left out of `S`, and the covariance is enlarged until the parameters
//!   move by what the posterior says ([`factor`]).

mod curves;
mod factor;
mod kriging;
mod noise;
mod pilot;
mod size;
mod taper;
#[cfg(test)]
mod tests;

use crate::data::Observations;
use crate::linalg::Matrix;
use crate::plugin::Forward;
use crate::run::Stop;
use crate::study::Study;

use super::best_fit;
use super::common_error::Allowance;
use super::surrogate::Fitted;
pub use curves::{Curves, Runs, rows_near_prior};
use factor::Shifts;
use pilot::Pilot;
use size::Size;
use taper::Places;

/// The error of a fitted emulator as these data meet it.
pub fn allowance(
    study: &Study,
    fitted: &Fitted,
    data: &Observations,
    forward: &dyn Forward,
) -> Result<Allowance, Stop> {
    let curves = fitted.curves.near_prior(study);
    Ok(Allowance::new("emulator", factors(study, &curves, data, forward)?))
}

/// The covariance of an error of which some curves are known, as factors of low rank, `outputs x rank`: enlarged by the factor
/// that estimates ask for, and of the size of the curves.
pub fn factors(
    study: &Study,
    curves: &Curves,
    data: &Observations,
    forward: &dyn Forward,
) -> Result<[Matrix; 2], Stop> {
    let best = best_fit::point(study, data, forward)?;
    let size = Size::learned(curves);
    let noise = noise::of_mean(study, data, forward, &best, &curves.errors)?;
    let places = Places::of(&study.layouts);
    let shapes = size.without(&curves.errors);
    let shifts = Shifts::of(curves, &shapes, &size, &places, &noise);
    let slopes = |point: &[f64]| best_fit::standard_slopes(study, forward, point);
    let factor = shifts.factor(&slopes);
    let there = if size.varies() {
        let even = shifts.covariance(&curves.errors);
        let slopes = slopes(&best);
        Pilot { study, forward, best: &best, slopes: &slopes }.size(&shifts, &even, &size)
    } else {
        1.0
    };
    let enlarged = places.factor(&scaled(&shapes, there * factor), &noise)?;
    let own = scaled(&enlarged, 1.0 / factor);
    Ok([enlarged, own])
}

fn scaled(matrix: &Matrix, factor: f64) -> Matrix {
    Matrix::from_fn(matrix.rows(), matrix.columns(), |i, j| factor * matrix[(i, j)])
}

/// At most so many of some things, evenly spaced.
fn thinned(count: usize, most: usize) -> Vec<usize> {
    let kept = count.min(most);
    (0..kept).map(|k| (2 * k + 1) * count / (2 * kept)).collect()
}

/// The least and the largest of each column of points; apart by one where they are the same.
fn ranges(points: &Matrix) -> Vec<(f64, f64)> {
    let range = |k: usize| {
        let column = points.column(k);
        let low = column.iter().copied().fold(f64::INFINITY, f64::min);
        let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if high > low { (low, high) } else { (low - 0.5, low + 0.5) }
    };
    (0..points.columns()).map(range).collect()
}
