//! Whether an effect is the same under all conditions, and on all sensors of its group, as its physics says.
//!
//! A wrong name often fits because its effect takes what one condition shows alone. The score of a change of its size on a part
//! of where it acts tells (Cox and Hinkley, Theoretical Statistics, section 9.3).

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::gap::fit::Fit;
use crate::gap::locate::{Projection, differences};
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::linalg::Matrix;
use crate::linalg::vector::dot;

/// The probability of the largest difference between the parts of where each effect acts if there is none; one where
/// there is nothing to compare. Bonferroni's bound over all parts.
pub fn consistency(system: &System<'_>, fit: &Fit, whitener: &Whitener) -> f64 {
    let experiment = system.experiment;
    let projection = Projection::of(system, fit);
    let mut rows = Matrix::zeros(0, experiment.outputs());
    let mut unknown = experiment.parameters.len();
    for effect in &system.effects {
        let slope = fit.at.tangents.row(unknown);
        unknown += effect.absent().len();
        for part in parts(system, &effect.acts) {
            let masked = slope.iter().zip(&part).map(|(x, on)| if *on { *x } else { 0.0 });
            rows.push_row(&masked.collect::<Vec<_>>());
        }
    }
    let white = whitener.whiten_rows(&rows);
    let lengths: Vec<f64> = white.iter_rows().map(|row| dot(row, row)).collect();
    let (left, squares) = projection.rest_of_rows(white);
    let (replicates, spread) = differences(experiment);
    let replicates = whitener.whiten_rows(&replicates);
    let freedom = spread.freedom + 4.0;
    let Ok(student) = StudentsT::new(0.0, 1.0, freedom) else { return 1.0 };
    let (mut least, mut count) = (1.0_f64, 0.0);
    for (j, row) in left.iter_rows().enumerate() {
        let seen = squares[j] > 1e-6 * lengths[j];
        if !seen {
            continue;
        }
        let own: f64 = replicates
            .iter_rows()
            .zip(&spread.weights)
            .map(|(d, w)| w * dot(d, row).powi(2) / squares[j])
            .sum();
        let variance = (4.0 + spread.freedom * own) / freedom;
        // The model's own variance of a score is one; common errors are in it.
        let t = dot(&fit.residual, row) / (squares[j] * variance.max(1.0)).sqrt();
        least = least.min(2.0 * (1.0 - student.cdf(t.abs())));
        count += 1.0;
    }
    if count > 0.0 { (least * count).min(1.0) } else { 1.0 }
}

/// The conditions, and the sensors, into which the outputs where an effect acts can be divided.
fn parts(system: &System<'_>, acts: &[bool]) -> Vec<Vec<bool>> {
    let experiment = system.experiment;
    let of = |chosen: &dyn Fn(&crate::gap::experiment::Curve) -> bool| {
        let mut part = vec![false; acts.len()];
        for curve in experiment.curves.iter().filter(|curve| chosen(curve)) {
            curve.measured.iter().filter(|&&i| acts[i]).for_each(|&i| part[i] = true);
        }
        part
    };
    let mut all = Vec::new();
    if experiment.conditions.len() > 1 {
        all.extend((0..experiment.conditions.len()).map(|c| of(&|curve| curve.condition == c)));
    }
    let mut sensors: Vec<&[(String, String)]> = Vec::new();
    for curve in experiment.curves.iter().filter(|c| c.measured.iter().any(|&i| acts[i])) {
        if !sensors.contains(&&curve.labels[..]) {
            sensors.push(&curve.labels);
        }
    }
    if sensors.len() > 1 {
        all.extend(sensors.iter().map(|labels| of(&|curve| curve.labels[..] == **labels)));
    }
    all.retain(|part| part.contains(&true));
    all
}
