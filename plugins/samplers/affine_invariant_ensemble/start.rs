//! What starting points must satisfy.

use lacuna::linalg::{Matrix, thin_svd};
use lacuna::run::Stop;

use super::AffineInvariantEnsemble;

/// The largest condition number of the starting points, as in emcee.
const LARGEST_CONDITION: f64 = 1e8;

impl AffineInvariantEnsemble {
    /// Checks number and place of the starting points.
    pub(super) fn check_start(&self, dimension: usize, points: &Matrix) -> Result<(), Stop> {
        let (rows, columns) = (points.rows(), points.columns());
        if dimension == 0 {
            return Err(Stop::new("there is nothing to sample: no parameter is unknown"));
        }
        if (rows, columns) != (self.walkers, dimension) {
            return Err(Stop::new(format!(
                "expected a starting point of {dimension} coordinates for each of {} walkers, \
                 found {rows} points of {columns}",
                self.walkers
            )));
        }
        let least = 2 * (dimension + 1);
        if rows < least || !rows.is_multiple_of(2) {
            return Err(Stop::new(format!(
                "{rows} walkers cannot sample {dimension} unknowns: \
                 expected an even number, at least {least}"
            ))
            .help(format!(
                "set `walkers` of the sampler to {} or more",
                least.max(10 * dimension)
            )));
        }
        if !(self.stretch > 1.0 && self.stretch.is_finite()) {
            return Err(Stop::new(format!(
                "expected `stretch` of the sampler above 1, found {}",
                self.stretch
            )));
        }
        if points.as_slice().iter().any(|x| !x.is_finite()) {
            return Err(Stop::new("a starting point of the walkers is not finite"));
        }
        spanning(points)
    }
}

/// Walkers that start on a plane never leave it: their steps are combinations of their places.
fn spanning(points: &Matrix) -> Result<(), Stop> {
    let (count, dimension) = (points.rows(), points.columns());
    let mut centred = points.clone();
    for j in 0..dimension {
        let mean = points.column(j).iter().sum::<f64>() / count as f64;
        let largest = points.column(j).iter().fold(0.0_f64, |m, x| m.max((x - mean).abs()));
        // What rounding leaves of equal values is no spread.
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
        .map_err(|error| Stop::new(format!("the starting points cannot be judged: {error}")))?
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

/// Checks that each walker starts where the density is above zero.
pub(super) fn check_support(log_density: &[f64]) -> Result<(), Stop> {
    let outside: Vec<String> = log_density
        .iter()
        .enumerate()
        .filter(|(_, value)| !value.is_finite())
        .map(|(walker, _)| (walker + 1).to_string())
        .collect();
    if outside.is_empty() {
        return Ok(());
    }
    let named = outside.iter().take(5).map(String::as_str).collect::<Vec<_>>().join(", ");
    let more = if outside.len() > 5 { ", and more" } else { "" };
    Err(Stop::new(format!(
        "{} of {} walkers start where the posterior density is zero or has no value: \
         number {named}{more}",
        outside.len(),
        log_density.len()
    )))
}
