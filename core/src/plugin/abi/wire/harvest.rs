//! What samplers bring home, beside the numbers.

use serde::{Deserialize, Serialize};

use crate::plugin::Fact;
use crate::plugin::sampler::Evidence;

/// What a harvest says beside its draws.
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
    /// What is worth telling.
    #[serde(default)]
    pub facts: Vec<Fact>,
}
