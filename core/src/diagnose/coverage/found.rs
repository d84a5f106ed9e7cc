//! How the cases of a study were made, with what was counted.

use serde::{Deserialize, Serialize};

use super::Tally;

/// Where the noise of the data that are made comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Noise {
    /// The residuals of the study's replicates about their mean, whole replicates with random signs: nothing is assumed
    /// of their law but that it is symmetric, and nothing of the model's form is in them.
    Replicates,
    /// The discrepancy at draws of the study's own posterior.
    Posterior,
    /// The discrepancy with unknowns drawn from their priors: simulation-based calibration in the strict sense, of the
    /// discrepancy's unknowns too.
    Prior,
}

/// Where the responses of the truths come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// The study's model at points of the prior.
    Model,
    /// The model with finer numerics and what is missing to the limit, as `[numerical_error]` says.
    FinerModel,
    /// Runs that the emulator of the case was not fitted to.
    HeldBack,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// The study's title.
    pub title: String,
    /// Its name.
    pub study: String,
    /// Its seed.
    pub seed: u64,
    /// The version of Lacuna.
    pub version: String,
    /// Whether chains were shortened and truths few.
    pub quick: bool,
    /// The noise of the data.
    pub noise: Noise,
    /// Where the truths' responses come from.
    pub source: Source,
    /// The standard deviation between replicates in the data that were made over that in the study's own, root mean
    /// squares over all values; `None` without replicates.
    pub noise_ratio: Option<f64>,
    /// The counts.
    pub tally: Tally,
    /// What a reader should know.
    pub notes: Vec<String>,
}
