//! Emulated responses with the study's effects.

use crate::linalg::Matrix;
use crate::plugin::Emulator;
use crate::study::Study;

/// The response at each point: parameters, effects' parameters and hyperparameters in natural units, one a row.
pub fn responses(study: &Study, emulator: &dyn Emulator, points: &Matrix) -> Vec<Vec<f64>> {
    let d = study.parameters.len();
    let theta = Matrix::from_rows(d, points.iter_rows().map(|p| &p[..d]));
    let mean = emulator.mean(&theta);
    let layout = &study.layout;
    mean.iter_rows()
        .zip(points.iter_rows())
        .map(|(mean, point)| {
            let mut response = mean.to_vec();
            let mut from = d;
            for effect in &study.effects {
                let plugin = &effect.built.plugin;
                let count = plugin.parameters(layout).len();
                response = plugin.apply(layout, &response, &point[from..from + count]);
                from += count;
            }
            response
        })
        .collect()
}
