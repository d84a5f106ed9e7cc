//! Figures of the probabilities of rare events, and their file.

use std::path::Path;

use lacuna::math::special::normal_quantile;
use lacuna::run::{Stop, files};
use lacuna_run::Artifact;
use serde::{Deserialize, Serialize};

/// Probabilities of rare events.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RareEvents {
    /// The events in the order of the study.
    pub events: Vec<RareEvent>,
}

/// Probability that a quantity of interest exceeds a limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RareEvent {
    /// Name of the probability.
    pub name: String,
    /// Name of the quantity.
    pub quantity: String,
    /// Unit of the quantity and the limit.
    pub unit: String,
    /// Limit.
    pub limit: f64,
    /// True for values above the limit, false for those below.
    pub above: bool,
    /// Name of the method.
    pub method: String,
    /// Distribution of the parameters: `prior` or `posterior`.
    pub distribution: String,
    /// Probability.
    pub probability: f64,
    /// Coefficient of variation of the estimate; `None` for an approximation without sampling.
    pub variation: Option<f64>,
    /// 95 % interval of the estimate; `None` for an approximation without sampling.
    pub interval: Option<[f64; 2]>,
    /// Number of calls of the model or the emulator.
    pub calls: usize,
    /// Number of calls without an answer.
    pub undefined: usize,
    /// Number of standard normal variables of the errors of emulator and numerics that the probability contains.
    #[serde(default)]
    pub error_variables: usize,
    /// Number of calls at which the limit was exceeded.
    pub failures: Option<usize>,
    /// Points of the failure region nearest to the origin of the standard normal space.
    pub design_points: Vec<FoundPoint>,
    /// True if the criteria of the method are met.
    pub converged: bool,
    /// Sentences on what makes the estimate doubtful.
    pub warnings: Vec<String>,
}

/// A design point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundPoint {
    /// Distance from the origin of the standard normal space.
    pub distance: f64,
    /// Parameters there, in their units.
    pub values: Vec<(String, f64)>,
    /// Share of each parameter in the variance of the linearised limit state.
    pub importance: Vec<(String, f64)>,
    /// Share of the errors of emulator and numerics in it.
    #[serde(default)]
    pub error_importance: f64,
}

impl RareEvent {
    /// Reliability index: minus the standard normal quantile of the probability.
    pub fn index(&self) -> f64 {
        -normal_quantile(self.probability)
    }
}

const FILE: &str = "reliability.json";

impl Artifact for RareEvents {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        files::write_json(&folder.join(FILE), self)?;
        Ok(vec![FILE.to_owned()])
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        files::read_json(&folder.join(FILE))
    }
}
