//! Conditions on the starting points.

use lacuna::math::moments::Moments;
use lacuna::run::Stop;
use lacuna_linalg::{Matrix, thin_svd};

use super::AffineInvariantEnsemble;
use crate::samplers::chains;

/// Largest condition number of the starting points, as in emcee.
const LARGEST_CONDITION: f64 = 1e8;

impl AffineInvariantEnsemble {
    /// Returns the minimum number of walkers: twice as many as span the space, and in each half as many as the
    /// largest move needs.
    pub(super) fn least(&self, dimension: usize) -> usize {
        let needed = self.moves.shares().iter().map(|(kind, _)| kind.needs(self.subset)).max();
        2 * (dimension + 1).max(needed.unwrap_or(1))
    }

    /// Returns the number of walkers for so many unknowns: as stated, or as few as possible.
    pub(super) fn planned(&self, dimension: usize) -> usize {
        self.walkers.max(self.least(dimension))
    }

    /// Checks number, dimension, finiteness and spread of the starting points, and the options that depend on them.
    pub(super) fn check_start(&self, dimension: usize, points: &Matrix) -> Result<(), Stop> {
        chains::check_points(points, self.planned(dimension), dimension, "walkers")?;
        let rows = points.rows();
        if !rows.is_multiple_of(2) {
            return Err(Stop::new(format!(
                "{rows} walkers cannot move in two halves: expected an even number"
            )));
        }
        if !(self.stretch > 1.0 && self.stretch.is_finite()) {
            return Err(Stop::new(format!(
                "expected `stretch` of the sampler above 1, found {}",
                self.stretch
            )));
        }
        if !self.moves.are_sound() || self.subset < 2 {
            return Err(Stop::new(
                "expected `moves` of the sampler with weights from 0 up, one of them above 0, \
                 and a `subset` of at least 2",
            ));
        }
        spanning(points)
    }
}

/// Fails if the starting points lie in a hyperplane: every move is a combination of positions and would never leave
/// it.
///
/// The condition number is taken after scaling each coordinate to unit norm, so that the units of the unknowns do not
/// matter.
fn spanning(points: &Matrix) -> Result<(), Stop> {
    let (count, dimension) = (points.rows(), points.columns());
    let mut centred = points.clone();
    for j in 0..dimension {
        let mean = points.column(j).iter().sum::<f64>() / count as f64;
        let largest = points.column(j).iter().fold(0.0_f64, |m, x| m.max((x - mean).abs()));
        // Rounding errors of equal values do not count as spread.
        if largest <= 8.0 * f64::EPSILON * mean.abs() {
            return Err(Stop::new(format!(
                "all walkers start with the same value {mean} of coordinate {}, \
                 and would keep it",
                j + 1
            )));
        }
        let norm = |sum: f64| sum.sqrt() * largest;
        let sum = points.column(j).iter().map(|x| ((x - mean) / largest).powi(2)).sum::<f64>();
        (0..count).for_each(|i| centred[(i, j)] = (points[(i, j)] - mean) / norm(sum));
    }
    let values = thin_svd(&centred)
        .map_err(|error| {
            Stop::new(format!(
                "the singular values of the starting points cannot be computed: {error}"
            ))
        })?
        .values;
    let extreme = |pick: fn(f64, f64) -> f64, from| values.iter().copied().fold(from, pick);
    let condition = extreme(f64::max, 0.0) / extreme(f64::min, f64::INFINITY);
    if condition.is_nan() || condition > LARGEST_CONDITION {
        return Err(Stop::new(format!(
            "the starting points of the walkers do not span the space of {dimension} unknowns: \
             their condition number is {condition:.1e}, expected at most {LARGEST_CONDITION:e}"
        ))
        .help("draw the starting points independently in each unknown"));
    }
    Ok(())
}

/// Returns the standard deviation of the starting points in each coordinate.
pub(super) fn lengths(points: &Matrix) -> Vec<f64> {
    Moments::of_rows(points).sd()
}
