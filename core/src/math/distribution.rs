//! Distributions.
use serde::{Deserialize, Serialize};
/// A distribution.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// Uniform on an interval.
    Uniform([f64; 2]),
}
