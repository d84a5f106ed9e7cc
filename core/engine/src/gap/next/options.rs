//! The options: further replicates of all that was measured, of one condition, or by one sensor.

use super::hypothesis::Hypothesis;
use super::information::Predicted;
use super::without_errors;
use crate::gap::candidates::{place, sensors};
use crate::gap::experiment::{Experiment, MeasuredCurve};
use crate::gap::noise::Noise;
use crate::gap::search::FurtherData;
use crate::gap::system::whitener::Whitener;

use lacuna_linalg::Matrix;

/// Numbers of further replicates.
const REPLICATES: [usize; 2] = [1, 4];

/// Further replicates of some of the curves.
pub(super) struct Choice<'a> {
    /// The measurements; `None` for all.
    pub what: Option<FurtherData>,
    /// The number of replicates.
    pub replicates: usize,
    experiment: Experiment<'a>,
    noise: Noise,
}

impl Choice<'_> {
    /// The new data under a hypothesis, whitened by their noise around the response of a reference.
    pub fn predicted(&self, own: &Hypothesis, reference: &Hypothesis) -> Predicted {
        let counts = vec![self.replicates as f64; self.experiment.outputs()];
        let around = &reference.response;
        let whitener = Whitener::of_counts(&self.experiment, &self.noise, around, &counts);
        let difference = own.response.iter().zip(around).map(|(a, b)| a - b);
        let rows = Matrix::from_rows(around.len(), [difference.collect::<Vec<f64>>()]);
        Predicted {
            mean: whitener.whiten_rows(&rows).into_vec(),
            slopes: whitener.whiten_rows(&own.tangents),
            precision: own.precision.clone(),
        }
    }
}

/// The options of an experiment with this noise.
pub(super) fn options<'a>(experiment: &Experiment<'a>, noise: &Noise) -> Vec<Choice<'a>> {
    let mut wanted: Vec<(Option<FurtherData>, Vec<bool>)> = Vec::new();
    let curves = &experiment.curves;
    wanted.push((None, vec![true; curves.len()]));
    if experiment.conditions.len() > 1 {
        for condition in &experiment.conditions {
            let own = (0..curves.len()).map(|s| condition.curves.contains(&s)).collect();
            let scenario = condition.scenario.clone();
            wanted.push((Some(FurtherData::Condition { scenario }), own));
        }
    }
    let sensors = sensors(experiment);
    if sensors.len() > 1 {
        for on in sensors {
            let own = curves.iter().map(|curve| place(curve) == on).collect();
            wanted.push((Some(FurtherData::Sensor { on }), own));
        }
    }
    let each = wanted.into_iter().filter_map(|(what, chosen)| {
        let (experiment, noise) = restricted(experiment, noise, &chosen)?;
        Some((what, experiment, noise))
    });
    each.flat_map(|(what, experiment, noise)| {
        REPLICATES.map(|replicates| Choice {
            what: what.clone(),
            replicates,
            experiment: experiment.clone(),
            noise: noise.clone(),
        })
    })
    .collect()
}

/// The experiment and the noise of some of the curves; `None` if the noise is correlated between several that are chosen
/// and others, or if nothing is measured.
fn restricted<'a>(
    experiment: &Experiment<'a>,
    noise: &Noise,
    chosen: &[bool],
) -> Option<(Experiment<'a>, Noise)> {
    let (mut experiment, mut noise) = (without_errors(experiment), noise.clone());
    for (condition, across) in experiment.conditions.iter().zip(&mut noise.across) {
        let count = chosen[condition.curves.clone()].iter().filter(|own| **own).count();
        match count {
            // A curve alone has the variance that its own noise states.
            0 | 1 => *across = None,
            _ if count < condition.curves.len() && across.is_some() => return None,
            _ => {}
        }
    }
    let left_out = |curve: &mut MeasuredCurve| {
        curve.measured.clear();
        curve.at.clear();
    };
    experiment
        .curves
        .iter_mut()
        .zip(chosen)
        .filter(|(_, own)| !**own)
        .for_each(|(c, _)| left_out(c));
    let is_measured = experiment.curves.iter().any(|curve| !curve.measured.is_empty());
    is_measured.then_some((experiment, noise))
}
