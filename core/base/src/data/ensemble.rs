//! Simulation runs.

use serde::{Deserialize, Serialize};

use super::{Layouts, Unit};
use crate::matrix::Matrix;

/// Simulation runs: parameters and response of each run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ensemble {
    /// Names of the parameters, one per column of `points`.
    pub parameters: Vec<String>,
    /// Units of the parameters.
    pub units: Vec<Unit>,
    /// Name of each run, one per row of `points`.
    pub runs: Vec<String>,
    /// Parameter values, `runs x parameters`, in the units above.
    pub points: Matrix,
    /// Layouts of the response of one run.
    pub layouts: Layouts,
    /// Responses, `runs x layouts.len()`, all finite.
    pub responses: Matrix,
    /// For each run, true if the model reports that the run stayed inside its range of validity.
    pub valid: Vec<bool>,
    /// Runs without a usable response, with the reason.
    pub failed: Vec<FailedRun>,
}

/// A run without a usable response.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedRun {
    /// Name of the run.
    pub run: String,
    /// Reason why the run has no response, as a sentence.
    pub reason: String,
}
