//! The keys of the simulation runs and of the measured data.

use schemars::JsonSchema;
use serde::Serialize;

use super::value::{ByName, Quantity};
use crate::report::findings::{EnsembleFindings, MeasuredFindings};
use crate::screening::{ActiveSubspace, Screening};

/// Numbers of simulation runs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Runs {
    /// Number of runs with a response.
    pub used: usize,
    /// Number of runs without a response.
    pub failed: usize,
    /// Number of runs outside the range of validity of the model.
    pub invalid: usize,
    /// Number of runs inside the support of the prior.
    pub in_prior: usize,
    /// Effect of each input as far as the runs show it, without a surrogate.
    #[serde(skip_serializing_if = "ByName::is_empty")]
    #[schemars(extend("propertyNames" = { "title": "input" }))]
    pub screening: ByName<ScreenedInput>,
    /// Directions of the inputs in which the response changes, from the derivatives at the runs (`gradients` of
    /// `[surrogate]`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub active_subspace: Option<Subspace>,
}

/// Mean outer product of the gradients of the response with themselves (active subspace), with inputs in standard deviations
/// of their designs and responses in theirs over the runs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Subspace {
    /// Number of runs with derivatives.
    pub runs: usize,
    /// Eigenvalues, decreasing: mean square slopes of the response along the eigenvectors.
    pub eigenvalues: Vec<Eigenvalue>,
    /// Mean square slope of the response along each input.
    #[schemars(extend("propertyNames" = { "title": "input" }))]
    pub activity: ByName<Quantity>,
}

/// Eigenvalue, with the central 95 % of its values over resampled runs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Eigenvalue {
    /// Value from all runs.
    pub value: Quantity,
    /// Lower end.
    pub q025: f64,
    /// Upper end.
    pub q975: f64,
}

impl Subspace {
    fn of(found: &ActiveSubspace, ensemble: &EnsembleFindings) -> Self {
        let pairs = found.eigenvalues.iter().zip(&found.spread);
        let value = |(&value, &(q025, q975)): (&f64, &(f64, f64))| Eigenvalue {
            value: value.into(),
            q025,
            q975,
        };
        let names = ensemble.inputs.iter().map(|input| input.name.clone());
        let activity = found.activity.iter().map(|slope| Quantity(*slope));
        Self {
            runs: found.runs,
            eigenvalues: pairs.map(value).collect(),
            activity: names.zip(activity).collect(),
        }
    }
}

/// Effect of an input as far as the runs show it: from runs along trajectories, each of which changes one input at a time, its
/// elementary effects, from other runs a test of independence.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ScreenedInput {
    /// Dependence of the response on the input, from 0 to 1: the Hilbert-Schmidt independence criterion, normalised.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hsic: Option<Quantity>,
    /// Probability of at least this dependence if the input had no effect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p: Option<f64>,
    /// Mean absolute elementary effect: change of the response over the range of the input, in standard deviations of
    /// the response over the runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mu_star: Option<Quantity>,
    /// Standard deviation of the elementary effects, in the same unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma: Option<Quantity>,
    /// False if the runs show no effect of the input: `p` is at least 0.05, or `mu_star` below a twentieth of the
    /// largest.
    pub acts: bool,
}

impl Runs {
    pub fn of(ensemble: &EnsembleFindings) -> Self {
        Self {
            screening: screening(ensemble),
            active_subspace: ensemble.active.as_ref().map(|found| Subspace::of(found, ensemble)),
            used: ensemble.points.rows(),
            failed: ensemble.failed.len(),
            invalid: ensemble.valid.iter().filter(|valid| !**valid).count(),
            in_prior: ensemble.in_prior,
        }
    }
}

fn screening(ensemble: &EnsembleFindings) -> ByName<ScreenedInput> {
    let Some(found) = &ensemble.screening else {
        return std::iter::empty().collect();
    };
    let acts = found.acts();
    let none = |acts| ScreenedInput { hsic: None, p: None, mu_star: None, sigma: None, acts };
    let entry = |j: usize| match found {
        Screening::Dependence(all) => {
            ScreenedInput { hsic: Some(all[j].index.into()), p: Some(all[j].p), ..none(acts[j]) }
        }
        Screening::Effects(all) => ScreenedInput {
            mu_star: Some(all[j].mean_absolute.into()),
            sigma: Some(all[j].sd.into()),
            ..none(acts[j])
        },
    };
    ensemble.inputs.iter().enumerate().map(|(j, input)| (input.name.clone(), entry(j))).collect()
}

/// Measured data.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Data {
    /// Number of replicates that the calibration used.
    pub replicates: usize,
    /// Number of measured values in those replicates.
    pub values: usize,
    /// Number of data in the likelihood, added curves included.
    pub count: usize,
    /// Hash of the data in the likelihood. Evidences and predictions of two runs are comparable only if it is equal.
    pub sha256: String,
    /// Curves per group that the likelihood uses in addition to the replicates.
    pub added_curves: Vec<String>,
    /// Number of curves that the screen for outliers flagged.
    pub flagged: usize,
    /// Number of flagged curves that were excluded from the calibration.
    pub left_out: usize,
}

impl Data {
    pub fn of(measured: &MeasuredFindings) -> Self {
        Self {
            replicates: measured.used.replicates(),
            values: measured.used.count(),
            count: measured.data_count,
            sha256: measured.fingerprint.clone(),
            added_curves: measured.added_curves.clone(),
            flagged: measured.flagged.len(),
            left_out: measured.flagged.iter().filter(|curve| curve.left_out).count(),
        }
    }
}
