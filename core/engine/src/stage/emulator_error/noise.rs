//! Variance of the measured mean, without the error of the emulator.

use lacuna::data::Observations;
use lacuna::plugin::Forward;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::column_squares;
use crate::study::Study;

/// Smallest fraction of the residual variance of the best fit that counts as noise.
const LEAST: f64 = 0.1;

/// Variance of the mean of the measured replicates by output, NaN where nothing was measured: as stated by the data, as
/// stated by the discrepancy, from the scatter of the replicates, or otherwise from the residuals of the best fit
/// beyond the emulator's errors.
pub fn of_mean(
    study: &Study,
    data: &Observations,
    forward: &dyn Forward,
    best: &[f64],
    errors: &Matrix,
) -> Result<Vec<f64>, Stop> {
    let response = forward.mean(&Matrix::from_rows(best.len(), [best]));
    of_mean_at(study, data, response.row(0), errors)
}

/// Like [`of_mean`], with the response of the best fit.
pub fn of_mean_at(
    study: &Study,
    data: &Observations,
    response: &[f64],
    errors: &Matrix,
) -> Result<Vec<f64>, Stop> {
    let summaries = data.summaries();
    let section =
        study.discrepancy.as_ref().ok_or_else(|| Stop::new("the study has no discrepancy"))?;
    let squares = column_squares(errors);
    let mut all = Vec::with_capacity(summaries.len());
    for (layout, range) in study.layouts.parts() {
        let (own, part) = (&summaries[range.clone()], &response[range.clone()]);
        let stated = section.built.plugin.stated_noise(layout, part);
        let freedom: f64 = own.iter().map(|s| (s.count as f64 - 1.0).max(0.0)).sum();
        let scatter: f64 = own.iter().map(|s| s.scatter).sum();
        let measured = || (0..own.len()).filter(|&j| own[j].count > 0);
        let count = measured().count().max(1) as f64;
        let pooled = if freedom > 0.0 && scatter > 0.0 {
            scatter / freedom
        } else {
            let left = measured().map(|j| (own[j].mean - part[j]).powi(2)).sum::<f64>() / count;
            let runs = errors.rows().max(1) as f64;
            let of_emulator =
                measured().map(|j| squares[range.start + j] / runs).sum::<f64>() / count;
            // The residuals contain the emulator's error, which is in the covariance already; the limit keeps a poor
            // emulator from explaining all of them.
            (left - of_emulator).max(LEAST * left)
        };
        let variance = |j: usize| {
            let of_data = own[j].stated.map(|sd| sd * sd);
            let of_law = || stated.as_ref().map(|stated| stated.sd[j].powi(2));
            of_data.or_else(of_law).unwrap_or(pooled).max(f64::MIN_POSITIVE)
        };
        all.extend((0..own.len()).map(|j| match own[j].count {
            0 => f64::NAN,
            count => variance(j) / count as f64,
        }));
    }
    Ok(floored(all, errors))
}

/// Applies a lower limit, because with noise-free data any error would be infinitely improbable.
fn floored(noise: Vec<f64>, errors: &Matrix) -> Vec<f64> {
    let mean = errors.as_slice().iter().map(|e| e * e).sum::<f64>()
        / errors.as_slice().len().max(1) as f64;
    noise.into_iter().map(|v| if v.is_nan() { v } else { v.max(1e-6 * mean) }).collect()
}
