//! `relaxation`: an exponential approach to a value.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::of;

/// Relaxation: an approach to a value at a rate in proportion to the distance from it.
///
/// ```text
/// rate = … + coefficient (toward - u),   coefficient ≥ 0
/// ```
///
/// Newton's law of cooling, leaks, first-order kinetics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Relaxation {
    /// Relaxing quantity `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Value that `u` approaches, as an expression such as `"20 {K}"`.
    pub toward: String,
}

impl Component for Relaxation {}

impl Term for Relaxation {
    fn describe(&self) -> Description {
        Description {
            title: "relaxation: an approach to a value".into(),
            formula: "coefficient * (toward - u)".into(),
            source: "Newton, Phil. Trans. 22 (1701) 824".into(),
        }
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let (u, toward) = (of(self.of.as_deref(), place), &self.toward);
        let shape = format!("({toward}) - ({u})");
        Ok(Summand { shape, sign: Sign::Positive, ..Summand::default() })
    }
}

lacuna::register!(Term, "relaxation", Relaxation);
