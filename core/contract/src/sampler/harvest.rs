//! Checks of a harvest.

use lacuna::math::moments::{mean, variance};
use lacuna::plugin::Target;
use lacuna::plugin::sampler::{Evidence, Harvest};

use super::targets::{MEAN, SD};

/// Largest standard error of a log evidence that is of any use.
const LARGEST_ERROR: f64 = 0.5;
/// Tolerance of a log evidence, whatever its standard error.
const TOLERANCE: f64 = 0.1;

/// Requires finite points with the log densities of these very points, and a plausible effective size.
pub(super) fn is_sound(
    harvest: &Harvest,
    target: &dyn Target,
    inside: impl Fn(&[f64]) -> bool,
) -> Result<(), String> {
    let (rows, size) = (harvest.points.rows(), harvest.effective_size);
    if rows == 0 || harvest.points.columns() != target.dimension() {
        return Err("the harvest has no points of the target's dimension".into());
    }
    if let Some(point) = harvest.points.iter_rows().find(|point| !inside(point)) {
        return Err(format!("the harvest has a point outside the support, {point:?}"));
    }
    if harvest.log_density != target.log_density(&harvest.points) {
        return Err("a log density of the harvest is not that of its point".into());
    }
    if !(size > 0.0 && size <= rows as f64) {
        return Err(format!("{rows} draws of the harvest are said to be worth {size}"));
    }
    Ok(())
}

/// Requires a log evidence within a tenth or four standard errors of the exact one.
pub(super) fn evidence_is(evidence: &Evidence, expected: f64) -> Result<(), String> {
    let Evidence { log, error, .. } = evidence;
    if !(*error >= 0.0 && *error <= LARGEST_ERROR) {
        return Err(format!("the log evidence has the error {error}"));
    }
    let within = (log - expected).abs() <= TOLERANCE.max(4.0 * error);
    if within {
        Ok(())
    } else {
        Err(format!("the log evidence is {log} +- {error} and not {expected}"))
    }
}

/// Requires that both halves have the same mean log density, because draws must be in random order.
pub(super) fn is_in_random_order(harvest: &Harvest) -> Result<(), String> {
    let (first, second) = harvest.log_density.split_at(harvest.log_density.len() / 2);
    // Each mean is over half of the effective draws.
    let error = 2.0 * (variance(&harvest.log_density) / harvest.effective_size).sqrt();
    let gap = (mean(first) - mean(second)).abs();
    if gap <= 4.0 * error {
        Ok(())
    } else {
        Err(format!("the halves of the harvest differ by {gap} in their mean log density"))
    }
}

/// Errors of mean and standard deviation of coordinate `j` according to the effective size.
pub(super) fn errors(harvest: &Harvest, j: usize) -> (f64, f64) {
    let values = harvest.points.column(j);
    let squares: Vec<f64> = values.iter().map(|x| (x - MEAN[j]).powi(2)).collect();
    let error = |values: &[f64]| (variance(values) / harvest.effective_size).sqrt();
    (error(&values), error(&squares) / (2.0 * SD[j]))
}
