//! Responses of the forward map with the study's effects.

use crate::linalg::Matrix;
use crate::plugin::Forward;
use crate::study::Study;

/// The response at each point: parameters, effects' parameters and hyperparameters in natural units, one a row.
pub fn responses(study: &Study, forward: &dyn Forward, points: &Matrix) -> Vec<Vec<f64>> {
    let d = study.parameters.len();
    let theta = Matrix::from_rows(d, points.iter_rows().map(|p| &p[..d]));
    let mean = forward.mean(&theta);
    let effects = study.placed_effects();
    mean.iter_rows()
        .zip(points.iter_rows())
        .map(|(mean, point)| {
            let mut response = mean.to_vec();
            let mut from = d;
            for effect in &effects {
                let count = effect.absent().len();
                response = effect.apply(&response, &point[from..from + count]);
                from += count;
            }
            response
        })
        .collect()
}
