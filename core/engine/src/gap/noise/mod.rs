//! The noise of the measurements, which tests and search must not mistake for a missing effect.
//!
//! With replicates, the noise is estimated from the differences between replicates of one condition, which a missing
//! effect does not change. Without replicates the study may state the noise; otherwise it is estimated from the single
//! record, which is less certain.

mod around;
mod autoregression;
mod curve;
mod expectation;
mod instrument;
mod lagged;
pub mod part;
mod products;
mod provenance;
mod record;
mod restricted;
mod shared;
mod simulate;
mod slow;
mod square;
mod stated;
mod succession;
#[cfg(test)]
mod tests;

use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

use super::experiment::{Experiment, MeasuredCurve};
use restricted::Known;
use stated::CurveStatement;

pub use around::ResponseTangents;
pub use autoregression::Autoregression;
pub use curve::{CurveNoise, Differences, ReplicateVariation, directions};
pub use succession::Succession;

/// Origin of the noise of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// From its replicates, or from those of the same curve under another condition.
    Replicates,
    /// As the study states it.
    Stated,
    /// As the study states it in part; the rest is from the single record.
    StatedInPart,
    /// From the single record, which may also contain the missing effect: the noise is assumed.
    Record,
}

/// The noise of one replicate of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// The noise of each curve; random effects that curves share are not in its `wander`.
    pub curves: Vec<CurveNoise>,
    /// The random effects of whole replicates on all curves of a condition together, one a condition.
    pub shared: Vec<ReplicateVariation>,
    /// The lower factor of the correlation of the innovations between the curves of a condition, if they are
    /// correlated.
    pub across: Vec<Option<Matrix>>,
    /// The origin of the noise of each curve.
    pub origins: Vec<Origin>,
}

impl Noise {
    /// The noise around a calibrated response; `like` gives the orders of the autoregressions of replicates.
    pub fn of(experiment: &Experiment<'_>, around: &ResponseTangents, like: Option<&Self>) -> Self {
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
            let others = || borrowed(experiment, s, &estimated);
            let said = experiment
                .stated
                .as_ref()
                .map(|all| CurveStatement::of(all, curve))
                .unwrap_or_default();
            let stated = || {
                if let Some(memory) = &said.memory {
                    return Some((said.with(memory.clone())?, Origin::Stated));
                }
                // Replicates elsewhere show how the noise is correlated.
                Some((said.with(others()?.memory)?, Origin::Stated))
            };
            let others = || Some((others()?, Origin::Replicates));
            let record = || of_record(curve, &means, around, &said);
            replicates().or_else(stated).or_else(others).unwrap_or_else(record)
        };
        let (mut curves, origins): (Vec<_>, Vec<_>) = (0..differences.len()).map(one).unzip();
        instrument::pool(experiment, &means, around, &origins, &mut curves);
        let conditions = experiment.conditions.len();
        let (shared, across) =
            (vec![ReplicateVariation::default(); conditions], vec![None; conditions]);
        let mut noise = Self { curves, shared, across, origins };
        shared::find(experiment, &differences, &mut noise);
        noise
    }

    /// Returns true if the noise of some curve, or a part of it, is estimated from its single record.
    pub fn is_assumed(&self) -> bool {
        self.origins.iter().any(|own| matches!(own, Origin::Record | Origin::StatedInPart))
    }

    /// The noise for an experiment `part` that has fewer values of the curves of `whole`.
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

    /// The standard deviation of one replicate at each output, in the response's unit; zero if nothing was measured.
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
    let same = |other: &MeasuredCurve| other.labels == curve.labels;
    let others = experiment.curves.iter().zip(estimated);
    let found = others.filter(|(other, _)| same(other)).find_map(|(_, noise)| noise.as_ref())?;
    Some(CurveNoise { profile: vec![1.0; curve.measured.len()], level: 0.0, ..found.clone() })
}

/// The noise of a curve from its single record and what is stated about it.
fn of_record(
    curve: &MeasuredCurve,
    means: &[f64],
    around: &ResponseTangents,
    said: &CurveStatement,
) -> (CurveNoise, Origin) {
    let (size, profile) = match said.size() {
        Some((mean, profile)) => (Some(mean), profile),
        None => (None, vec![1.0; curve.measured.len()]),
    };
    let each = curve.measured.iter().zip(&profile);
    let misfit: Vec<f64> = each.map(|(&i, w)| (means[i] - around.response[i]) / w).collect();
    let mut slopes = around.slopes.select_columns(&curve.measured);
    for j in 0..slopes.rows() {
        slopes.row_mut(j).iter_mut().zip(&profile).for_each(|(x, w)| *x /= w);
    }
    let known = Known { size, memory: said.memory.clone() };
    let (sd, memory) = record::noise(&misfit, &slopes, &curve.places(), &known);
    let stated = size.is_some() || known.memory.is_some();
    let origin = if stated { Origin::StatedInPart } else { Origin::Record };
    let wander = ReplicateVariation::default();
    (CurveNoise { sd, memory, level: 0.0, wander, profile }, origin)
}
