//! The harvest of samplers, beside the numbers.

use lacuna::plugin::Fact;
use lacuna::plugin::sampler::Evidence;
use serde::{Deserialize, Serialize};

/// A harvest without its draws.
#[derive(Debug, Serialize, Deserialize)]
pub struct HarvestAbout {
    /// The number of independent draws that they are worth.
    pub effective_size: f64,
    /// The evidence.
    #[serde(default)]
    pub evidence: Option<Evidence>,
    /// Reasons not to trust the draws.
    #[serde(default)]
    pub doubts: Vec<String>,
    /// Facts about the run, for people.
    #[serde(default)]
    pub facts: Vec<Fact>,
}
