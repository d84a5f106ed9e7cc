//! How replicates differ: the noise that a search for missing effects must not take for one.
//!
//! Everything is estimated from the differences between replicates of one condition, so that nothing that the model
//! misses can enter.

mod autoregression;
mod curve;
mod expectation;
mod products;
mod shared;
mod simulate;
#[cfg(test)]
mod tests;

pub use autoregression::Autoregression;
pub use curve::{CurveNoise, Differences, Wander, directions};

use serde::{Deserialize, Serialize};

use super::experiment::{Curve, Experiment};
use crate::linalg::Matrix;

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
    /// Whether each curve's noise is assumed from its misfit, for want of replicates.
    pub assumed: Vec<bool>,
}

impl Noise {
    /// From the replicates around this response; `like` gives the orders of the autoregressions.
    pub fn of(experiment: &Experiment<'_>, response: &[f64], like: Option<&Self>) -> Self {
        let differences: Vec<Differences> = experiment
            .curves
            .iter()
            .map(|curve| {
                let own: Vec<f64> = curve.measured.iter().map(|&i| response[i]).collect();
                Differences::new(&experiment.complete(curve), &own, &curve.at)
            })
            .collect();
        let order = |s: usize| like.map(|like| like.curves[s].memory.order());
        let estimated: Vec<Option<CurveNoise>> =
            differences.iter().enumerate().map(|(s, d)| d.noise(order(s))).collect();
        let curves = (0..differences.len())
            .map(|s| {
                let own = estimated[s].clone();
                own.or_else(|| borrowed(experiment, s, &estimated))
                    .unwrap_or_else(|| assumed(experiment, s, response))
            })
            .collect();
        let assumed = (0..differences.len())
            .map(|s| estimated[s].is_none() && borrowed(experiment, s, &estimated).is_none())
            .collect();
        let conditions = experiment.conditions.len();
        let (shared, across) = (vec![Wander::default(); conditions], vec![None; conditions]);
        let mut noise = Self { curves, shared, across, assumed };
        shared::find(experiment, &differences, &mut noise);
        noise
    }

    /// The same noise for an experiment of the same curves that measured fewer values of them.
    pub fn restricted(&self, whole: &Experiment<'_>, part: &Experiment<'_>) -> Self {
        let mut own = self.clone();
        for (s, noise) in own.curves.iter_mut().enumerate() {
            let places = whole.curves[s].measured.iter().zip(&self.curves[s].profile);
            let kept = places.filter(|(i, _)| part.curves[s].measured.contains(i));
            noise.profile = kept.map(|(_, w)| *w).collect();
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

/// White noise of the size of the differences between neighbouring values of the misfit (von Neumann, Annals of
/// Mathematical Statistics 12 (1941) 367): what varies slowly does not enter.
fn assumed(experiment: &Experiment<'_>, s: usize, response: &[f64]) -> CurveNoise {
    let curve = &experiment.curves[s];
    let (_, means) = experiment.means();
    let misfit: Vec<f64> = curve.measured.iter().map(|&i| means[i] - response[i]).collect();
    let squares: f64 = misfit.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    let steps = misfit.len().saturating_sub(1).max(1) as f64;
    let largest = misfit.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    let sd = (squares / (2.0 * steps)).sqrt().max(1e-6 * largest);
    CurveNoise {
        sd: if sd > 0.0 { sd } else { 1.0 },
        memory: Autoregression::white(),
        level: 0.0,
        wander: Wander::default(),
        profile: vec![1.0; curve.measured.len()],
    }
}
