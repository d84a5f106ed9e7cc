//! Known conditions of a run.

use serde::{Deserialize, Serialize};

/// Known conditions under which a response is simulated or measured, such as a beam power.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// The scenario's name; empty in a study with one set of conditions.
    pub name: String,
    /// Named values in the units that the study declares.
    pub values: Vec<(String, f64)>,
}
