//! Covariance of the emulator's error on the mean curve, scaled so that calibrations have their nominal coverage.
//!
//! The covariance is estimated from error curves `e_i` at runs on which the emulator was not trained ([`Curves`]), in
//! three steps:
//!
//! - The **size** `s(x)` relative to the mean, if the emulator or the number of runs allows it to be estimated
//!   (`size`); the covariance has the mean square size over the region of parameters that the data indicate (`pilot`).
//! - The **shape** `S` of `e_i / s_i`: few curves span few directions, and with a covariance of these directions alone
//!   the data would be fitted in all others as if the emulator were exact. Correlations at a distance are therefore
//!   damped (covariance taper: Houtekamer and Mitchell, Monthly Weather Review 129 (2001) 123; `taper`).
//! - A **factor**: generalised least squares finds the directions in which a covariance understates the error, whatever
//!   its shape. Each run is therefore taken as the truth and left out of `S`, and the covariance is enlarged until the
//!   parameters shift by as much as the posterior states (`factor`).

mod curves;
mod factor;
mod kriging;
pub(super) mod noise;
mod pilot;
mod size;
mod taper;
#[cfg(test)]
mod tests;

use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::best_fit::{self, Fit};
use super::common_error::Allowance;
use super::surrogate::Fitted;
use crate::study::Study;
use factor::Shifts;
use pilot::Pilot;
use size::Size;
use taper::{Places, Scaled};

pub use curves::{Curves, Runs, rows_near_prior};

/// The error of a fitted emulator, for these data.
pub fn allowance(study: &Study, fitted: &Fitted, fit: Fit<'_>) -> Result<Allowance, Stop> {
    let curves = fitted.curves.near_prior(study);
    Ok(Allowance::new(ErrorOrigin::Emulator, factors(study, &curves, fit)?))
}

/// The error of a fitted emulator with its mean size over the prior, where there are no data.
pub fn over_prior(study: &Study, fitted: &Fitted) -> Result<CommonError, Stop> {
    let curves = fitted.curves.near_prior(study);
    let factor = Places::of(&study.layouts).factor(&Scaled::plain(&curves.errors), &[])?;
    Ok(CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true })
}

/// Covariance of an error of which some curves are known, as two factors of low rank, `outputs x rank`: one enlarged by
/// the factor required for estimates, and one with the size of the curves.
pub fn factors(study: &Study, curves: &Curves, fit: Fit<'_>) -> Result<[Matrix; 2], Stop> {
    let Fit { data, forward, point: best } = fit;
    let size = Size::learned(curves);
    let noise = noise::of_mean(study, data, forward, best, &curves.errors)?;
    let places = Places::of(&study.layouts);
    let shifts = Shifts::of(curves, &size, &places, &noise);
    let slopes = |point: &[f64]| best_fit::standard_slopes(study, forward, point);
    let factor = shifts.factor(&slopes);
    let there = if size.varies() {
        let even = shifts.covariance();
        let slopes = slopes(best);
        Pilot { study, forward, best, slopes: &slopes }.size(&shifts, &even, &size)
    } else {
        1.0
    };
    let shapes =
        Scaled { errors: &curves.errors, divisors: Some(&size.at_curves), factor: there * factor };
    let enlarged = places.factor(&shapes, &noise)?;
    let own = scaled(&enlarged, 1.0 / factor);
    Ok([enlarged, own])
}

fn scaled(matrix: &Matrix, factor: f64) -> Matrix {
    Matrix::from_fn(matrix.rows(), matrix.columns(), |i, j| factor * matrix[(i, j)])
}

/// Sum of the squares of each column.
fn column_squares(matrix: &Matrix) -> Vec<f64> {
    let mut squares = vec![0.0; matrix.columns()];
    for row in matrix.iter_rows() {
        squares.iter_mut().zip(row).for_each(|(sum, e)| *sum += e * e);
    }
    squares
}

/// At most `most` of `count` indices, evenly spaced.
pub(super) fn thinned(count: usize, most: usize) -> Vec<usize> {
    let kept = count.min(most);
    (0..kept).map(|k| (2 * k + 1) * count / (2 * kept)).collect()
}

/// Smallest and largest value of each column of points; widened to a range of one if they are equal.
fn ranges(points: &Matrix) -> Vec<(f64, f64)> {
    let range = |k: usize| {
        let column = points.column(k);
        let low = column.iter().copied().fold(f64::INFINITY, f64::min);
        let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if high > low { (low, high) } else { (low - 0.5, low + 0.5) }
    };
    (0..points.columns()).map(range).collect()
}
