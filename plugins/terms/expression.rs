//! `expression`: a term that the study writes by itself.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign as Signs, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A term as an expression: whatever else may be in the rate of a state.
///
/// ```text
/// rate = … + coefficient shape
/// ```
///
/// The coefficient is called by the `name` of the section, and so is the effect when it is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expression {
    /// What the coefficient multiplies: an expression of states, inputs, definitions and the time.
    pub shape: String,
    /// The signs that the coefficient may have.
    #[serde(default)]
    pub sign: Sign,
}

/// The signs that a coefficient may have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sign {
    /// Both.
    #[default]
    Either,
    /// Above zero only.
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
