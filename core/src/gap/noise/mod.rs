//! The noise that a search for missing effects must not take for one.
//!
//! Where there are replicates, everything is estimated from the differences between those of one condition, so that nothing
//! that the model misses can enter. Without, the study may say how large the noise is; else the one record tells, less surely.

mod around;
mod autoregression;
mod curve;
mod expectation;
mod products;
mod record;
mod restricted;
mod shared;
mod simulate;
mod slow;
mod succession;
#[cfg(test)]
mod tests;

pub use around::Around;
pub use autoregression::Autoregression;
pub use curve::{CurveNoise, Differences, Wander, directions};
pub use succession::Succession;

use serde::{Deserialize, Serialize};

use super::experiment::{Curve, Experiment};
use crate::linalg::Matrix;
use crate::plugin::discrepancy::StatedNoise;

/// Where the noise of a curve is known from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// From its replicates, or from those of the same curve under another condition.
    Replicates,
    /// From what the study's discrepancy says.
    Stated,
    /// From the one record that there is, which may hold what the model misses too: it is assumed.
    Record,
}

/// The noise of one replicate of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// That of each curve alone; what curves share is not in its `wander`.
    pub curves: Vec<CurveNoise>,
    /// What whole replicates differ by on all curves of a condition together, one a condition.
    pub shared: Vec<Wander>,
    /// The lower factor of the correlation of the innovations between the curves of a condition, where there is
    /// one.
    pub across: Vec<Option<Matrix>>,
    /// Where that of each curve is known from.
    pub origins: Vec<Origin>,
}

impl Noise {
    /// Around a calibrated response; `like` gives the orders of the autoregressions of replicates.
    pub fn of(experiment: &Experiment<'_>, around: &Around, like: Option<&Self>) -> Self {
        let differences: Vec<Differences> = experiment
            .curves
            .iter()
            .map(|curve| {
                let own: Vec<f64> = curve.measured.iter().map(|&i| around.response[i]).collect();
                Differences::new(&experiment.complete(curve), &own, &curve.at)
            })
            .collect();
        let order = |s: usize| like.map(|like| like.curves[s].memory.order());
        let estimated: Vec<Option<CurveNoise>> =
            differences.iter().enumerate().map(|(s, d)| d.noise(order(s))).collect();
        let (_, means) = experiment.means();
        let one = |s: usize| {
            let curve = &experiment.curves[s];
            let replicates = || estimated[s].clone().map(|own| (own, Origin::Replicates));
            let stated = || {
                let stated = experiment.stated.as_ref()?;
                Some((of_statement(curve, stated), Origin::Stated))
            };
            let others = || Some((borrowed(experiment, s, &estimated)?, Origin::Replicates));
            let record = || (of_record(curve, &means, around), Origin::Record);
            replicates().or_else(stated).or_else(others).unwrap_or_else(record)
        };
        let (curves, origins) = (0..differences.len()).map(one).unzip();
        let conditions = experiment.conditions.len();
        let (shared, across) = (vec![Wander::default(); conditions], vec![None; conditions]);
        let mut noise = Self { curves, shared, across, origins };
        shared::find(experiment, &differences, &mut noise);
        noise
    }

    /// Whether that of some curve is assumed from its one record.
    pub fn is_assumed(&self) -> bool {
        self.origins.contains(&Origin::Record)
    }

    /// The same noise for an experiment of the same curves that measured fewer values of them.
    pub fn restricted(&self, whole: &Experiment<'_>, part: &Experiment<'_>) -> Self {
        let mut own = self.clone();
        for (s, noise) in own.curves.iter_mut().enumerate() {
            let mut wanted = part.curves[s].measured.iter().peekable();
            let mut kept = Vec::with_capacity(part.curves[s].measured.len());
            for (i, w) in whole.curves[s].measured.iter().zip(&self.curves[s].profile) {
                if wanted.next_if_eq(&i).is_some() {
                    kept.push(*w);
                }
            }
            noise.profile = kept;
        }
        for (c, condition) in part.conditions.iter().enumerate() {
            let mut lengths = condition.curves.clone().map(|s| part.curves[s].measured.len());
            let first = lengths.next();
            if lengths.any(|length| Some(length) != first) {
                own.across[c] = None;
            }
        }
        own
    }

    /// The standard deviation of one replicate at each output; zero where nothing was measured.
    pub fn sd(&self, experiment: &Experiment<'_>, response: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; experiment.outputs()];
        for (curve, noise) in experiment.curves.iter().zip(&self.curves) {
            let own: Vec<f64> = curve.measured.iter().map(|&i| response[i]).collect();
            let directions = directions(&own, &curve.at);
            let shared = self.shared[curve.condition].variances();
            for (k, &i) in curve.measured.iter().enumerate() {
                let white = (noise.sd * noise.profile[k]).powi(2) * noise.memory.variance();
                let wander: f64 = (0..3)
                    .map(|d| (noise.wander.variances()[d] + shared[d]) * directions[d][k].powi(2))
                    .sum();
                all[i] = (white + wander).sqrt();
            }
        }
        all
    }
}

/// The noise of the same sensor under another condition with replicates.
fn borrowed(
    experiment: &Experiment<'_>,
    s: usize,
    estimated: &[Option<CurveNoise>],
) -> Option<CurveNoise> {
    let curve = &experiment.curves[s];
    let same = |other: &Curve| other.labels == curve.labels;
    let others = experiment.curves.iter().zip(estimated);
    let found = others.filter(|(other, _)| same(other)).find_map(|(_, noise)| noise.as_ref())?;
    Some(CurveNoise { profile: vec![1.0; curve.measured.len()], level: 0.0, ..found.clone() })
}

/// The noise of a curve as the study states it.
fn of_statement(curve: &Curve, stated: &StatedNoise) -> CurveNoise {
    let sd: Vec<f64> = curve.measured.iter().map(|&i| stated.sd[i]).collect();
    let squares = sd.iter().map(|s| s * s).sum::<f64>();
    let mean = (squares / sd.len().max(1) as f64).sqrt();
    let times = stated.correlation_time.as_ref();
    let time = times.zip(curve.measured.first()).map(|(times, first)| times[*first]);
    let memory = match time {
        Some(time) if time > 0.0 => Autoregression::of_reflections(&[(-curve.step() / time).exp()]),
        _ => Autoregression::white(),
    };
    CurveNoise {
        sd: mean / memory.variance().sqrt(),
        memory,
        level: 0.0,
        wander: Wander::default(),
        // A response of zero may have no noise at all.
        profile: sd.iter().map(|s| (s / mean).max(1e-6)).collect(),
    }
}

/// The noise of a curve from its one record.
fn of_record(curve: &Curve, means: &[f64], around: &Around) -> CurveNoise {
    let misfit: Vec<f64> = curve.measured.iter().map(|&i| means[i] - around.response[i]).collect();
    let slopes = around.slopes.select_columns(&curve.measured);
    let (sd, memory) = record::noise(&misfit, &slopes, &curve.places());
    let profile = vec![1.0; curve.measured.len()];
    CurveNoise { sd, memory, level: 0.0, wander: Wander::default(), profile }
}
