//! Error of the mean curve of the replicates, which the points of a replicate share.
//!
//! All points of a replicate have its gain, its timing and its offset. The deviation of replicate `r` from the mean curve is
//! modelled, for each curve `k` (a gauge, say), as
//!
//! ```text
//! d_rk = sum_j a_rkj b_kj + rest,   a_rkj = common_rj + own_rkj
//! ```
//!
//! with the response at the best fit, its derivative along the abscissa, and one as `b_k1`, `b_k2`, `b_k3` ([`basis`]). The
//! variances of the common and of the own part are estimated over all replicates and curves, without what white noise makes
//! of them ([`components`]). What the three leave has its sample covariance, `sum_r rest_r rest_r' / (R (R - 1))`.
//!
//! The directions are those of the model. The sample covariance of whole curves has them only with their noise: with a few
//! replicates of many points a large part of its leading directions is noise (Paul, Statistica Sinica 17 (2007) 1617), and a
//! weighted fit finds what is left of the true ones and takes it as exact. Directions in proportion to the data
//! would pull estimates to smaller curves (D'Agostini, Nucl. Instrum. Methods A 346 (1994) 306).

mod basis;
mod components;
mod directions;

use lacuna::data::measurements::Summary;
use lacuna::data::{Measurements, Replicate};
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna_linalg::Matrix;

use self::basis::{Curve, KINDS};
use self::components::{Components, Fits};
use self::directions::Directions;
use super::read::Measured;
use crate::study::Study;

/// Least number of replicates whose scatter shows what their points share.
const FEWEST: usize = 3;

/// Returns true if a study includes the error of the replicates' mean and has curves long enough to tell gain, timing and
/// offset.
pub fn needs_best_fit(study: &Study, measured: &Measured) -> bool {
    let included = study.discrepancy.as_ref().is_some_and(|d| d.common.replicate_error);
    let included = included && !study.is_stochastic();
    let has_curves = |data: &Measurements| {
        let replicates = data.replicates.iter().filter(|r| r.values.iter().any(Option::is_some));
        let enough = data.covariance.is_none() && replicates.count() >= FEWEST;
        enough && basis::has_curves(&data.layout, &data.summaries())
    };
    included && measured.used.blocks.iter().any(has_curves)
}

/// Error of the mean curve of the replicates, with the response at the best fit if it is known; `None` with fewer than three
/// replicates.
pub fn of_replicates(data: &Measurements, response: Option<&[f64]>) -> Option<CommonError> {
    let summaries = data.summaries();
    let used = || data.replicates.iter().filter(|r| r.values.iter().any(Option::is_some));
    if used().count() < FEWEST {
        return None;
    }
    let deviations = used().map(|replicate| deviations(replicate, &summaries));
    let curves = response.map_or_else(Vec::new, |y| basis::curves(&data.layout, y, &summaries));
    let mut directions = Directions::of(data.layout.len());
    let fits = Fits::of(&curves, deviations, |rest| directions.add(&sampled(&rest, &summaries)));
    let mut columns = Vec::new();
    for kind in 0..KINDS {
        if let Some(components) = fits.components(kind) {
            columns.extend(shared(&components, &fits, (&curves, kind), &summaries));
            columns.extend(own(&components, (&curves, kind), &summaries));
        }
    }
    columns.extend(directions.into_columns());
    let factor = Matrix::from_fn(data.layout.len(), columns.len(), |i, k| columns[k][i]);
    Some(CommonError { origin: ErrorOrigin::Replicates, factor: factor.into(), predictive: false })
}

/// Deviation of a replicate from the mean, where at least two replicates have a value.
fn deviations(replicate: &Replicate, summaries: &[Summary]) -> Vec<Option<f64>> {
    let each = replicate.values.iter().zip(summaries);
    each.map(|(value, s)| value.filter(|_| s.count >= 2).map(|y| y - s.mean)).collect()
}

/// Error of the mean by the part that all curves of a replicate share: one column for all replicates with values in the
/// same curves, whose deviations are independent.
fn shared(
    components: &Components,
    fits: &Fits,
    (curves, kind): (&[Curve], usize),
    summaries: &[Summary],
) -> Vec<Vec<f64>> {
    if components.common == 0.0 {
        return Vec::new();
    }
    let mut patterns: Vec<(Vec<usize>, usize)> = Vec::new();
    for measured in fits.measured(kind) {
        match patterns.iter_mut().find(|(known, _)| *known == measured) {
            Some((_, count)) => *count += 1,
            None => patterns.push((measured, 1)),
        }
    }
    let column = |(measured, count): (Vec<usize>, usize)| {
        let mut column = vec![0.0; summaries.len()];
        for curve in measured.iter().map(|&k| &curves[k]) {
            for (&i, b) in curve.outputs.iter().zip(curve.function(kind)) {
                let replicates = summaries[i].count as f64;
                column[i] = b * (components.common * count as f64).sqrt() / replicates;
            }
        }
        column
    };
    patterns.into_iter().filter(|(measured, _)| !measured.is_empty()).map(column).collect()
}

/// Error of the mean by the part that each curve of a replicate has by itself.
fn own(
    components: &Components,
    (curves, kind): (&[Curve], usize),
    summaries: &[Summary],
) -> Vec<Vec<f64>> {
    let column = |(curve, relevant): (&Curve, &bool)| {
        let mut column = vec![0.0; summaries.len()];
        if *relevant {
            for (&i, b) in curve.outputs.iter().zip(curve.function(kind)) {
                column[i] = b * (components.own / summaries[i].count as f64).sqrt();
            }
        }
        relevant.then_some(column)
    };
    curves.iter().zip(&components.relevant).filter_map(column).collect()
}

/// Part of the sample covariance of the mean that one replicate contributes.
fn sampled(rest: &[Option<f64>], summaries: &[Summary]) -> Vec<f64> {
    // A missing value contributes nothing; the divisor uses the number of replicates of this output.
    let one = |(rest, s): (&Option<f64>, &Summary)| {
        let count = s.count as f64;
        rest.map_or(0.0, |d| d / (count * (count - 1.0)).sqrt())
    };
    rest.iter().zip(summaries).map(one).collect()
}

#[cfg(test)]
mod tests;
