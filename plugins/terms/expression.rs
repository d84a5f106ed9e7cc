//! `expression`: a term that the study defines.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign as Signs, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A term given by an expression: any further contribution to the rate of a state.
///
/// ```text
/// rate = … + coefficient shape
/// ```
///
/// The coefficient takes the `name` of the section, and so does the effect when it is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expression {
    /// Factor that the coefficient multiplies: an expression of states, inputs, definitions and the time.
    pub shape: String,
    /// Allowed signs of the coefficient.
    #[serde(default)]
    pub sign: Sign,
}

/// Allowed signs of a coefficient.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sign {
    /// Both signs.
    #[default]
    Either,
    /// Positive values only.
    Positive,
}

impl Component for Expression {}

impl Term for Expression {
    fn describe(&self) -> Description {
        Description {
            title: format!("the term {}", self.shape),
            formula: format!("coefficient * ({})", self.shape),
            source: "the study".into(),
        }
    }

    fn listed(&self) -> bool {
        false
    }

    fn summand(&self, _: &Place<'_>) -> Result<Summand, String> {
        let sign = match self.sign {
            Sign::Either => Signs::Either,
            Sign::Positive => Signs::Positive,
        };
        Ok(Summand { shape: self.shape.clone(), sign, ..Summand::default() })
    }
}

lacuna::register!(Term, "expression", Expression);
