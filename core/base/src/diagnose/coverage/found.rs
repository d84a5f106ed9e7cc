//! Result of a coverage study: how its cases were made, and the counts.

use serde::{Deserialize, Serialize};

use super::Tally;

/// Source of the noise in the generated data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Noise {
    /// Residuals of the study's replicates about their mean: whole replicates with random signs. Only the symmetry of
    /// their law is assumed, and they do not depend on the model.
    Replicates,
    /// The discrepancy at draws from the study's own posterior.
    Posterior,
    /// The discrepancy with unknowns drawn from their priors: simulation-based calibration in the strict sense,
    /// including the discrepancy's unknowns.
    Prior,
}

/// Source of the responses at the truths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// The study's model at points drawn from the prior.
    Model,
    /// The model with finer numerics, corrected to the limit as `[numerical_error]` states.
    FinerModel,
    /// Simulation runs held out from the fit of the emulator.
    HeldBack,
}

/// Result of a coverage study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// Title of the study.
    pub title: String,
    /// Name of the study.
    pub study: String,
    /// Seed of the study.
    pub seed: u64,
    /// Version of Lacuna.
    pub version: String,
    /// True if chains were shortened and few truths drawn.
    pub quick: bool,
    /// Source of the noise in the data.
    pub noise: Noise,
    /// Source of the responses at the truths.
    pub source: Source,
    /// Ratio of the standard deviation between replicates in the generated data to that in the study's own data, root
    /// mean squares over all values; `None` without replicates.
    pub noise_ratio: Option<f64>,
    /// Counts.
    pub tally: Tally,
    /// Notes to the reader.
    pub notes: Vec<String>,
}
