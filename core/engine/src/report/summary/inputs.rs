//! The keys of the simulation runs and of the measured data.

use schemars::JsonSchema;
use serde::Serialize;

use crate::report::findings::{EnsembleFindings, MeasuredFindings};

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
}

impl Runs {
    pub fn of(ensemble: &EnsembleFindings) -> Self {
        Self {
            used: ensemble.points.rows(),
            failed: ensemble.failed.len(),
            invalid: ensemble.valid.iter().filter(|valid| !**valid).count(),
            in_prior: ensemble.in_prior,
        }
    }
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
