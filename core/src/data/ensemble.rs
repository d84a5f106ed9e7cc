//! Simulation runs.

use serde::{Deserialize, Serialize};

use super::{Layouts, Unit};
use crate::linalg::Matrix;

/// Simulation runs: the parameters each was made with and its response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ensemble {
    /// The names of the parameters, one a column of `points`.
    pub parameters: Vec<String>,
    /// Their units.
    pub units: Vec<Unit>,
    /// The name of each run, one a row.
    pub runs: Vec<String>,
    /// The parameters, `runs x parameters`.
    pub points: Matrix,
    /// The shapes of the responses of one run.
    pub layouts: Layouts,
    /// The responses, `runs x layouts.len()`, all finite.
    pub responses: Matrix,
    /// Whether each run stayed inside the model's range of validity, as the model says.
    pub valid: Vec<bool>,
    /// Runs that were left out, with the reason.
    pub failed: Vec<FailedRun>,
}

/// A run without a usable response.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedRun {
    /// The run's name.
    pub run: String,
    /// Why it has no response, in words.
    pub reason: String,
}
