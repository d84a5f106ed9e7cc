//! Unit strings.
use serde::{Deserialize, Serialize};
/// A unit as written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Unit(String);
impl Unit {
    /// Parses.
    pub fn parse(text: &str) -> Result<Self, String> {
        Ok(Self(text.to_owned()))
    }
    /// Factor.
    pub fn factor_to(&self, _other: &Unit) -> Option<f64> {
        Some(1.0)
    }
}
impl std::fmt::Display for Unit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}
