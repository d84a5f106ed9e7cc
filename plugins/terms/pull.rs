//! `pull`: the gravity of a further body.

use std::collections::BTreeMap;

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::of;

/// The pull of a further body: gravity of a mass at some distance.
///
/// ```text
/// rate = … - coefficient u / distance³,   coefficient ≥ 0
/// ```
///
/// `u` is the component of the distance along the state, measured from the further body; the components along other
/// states share the coefficient, which is the mass of the body times the gravitational constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pull {
    /// Component `u` of the distance, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Distance to the further body, as an expression such as `"hypot(x - far, y)"`.
    pub distance: String,
    /// Further states with their components of the distance, such as `{ vy = "y" }`; they share the coefficient.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub beside: BTreeMap<String, String>,
}

impl Component for Pull {}

impl Term for Pull {
    fn describe(&self) -> Description {
        Description {
            title: "the pull of a further body".into(),
            formula: "- coefficient * u / distance^3".into(),
            source: "Newton, Principia (1687), book III".into(),
        }
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let shape = |u: &str| format!("-({u}) / ({})^3", self.distance);
        let beside = self.beside.iter().map(|(state, u)| (state.clone(), shape(u))).collect();
        let shape = shape(of(self.of.as_deref(), place));
        Ok(Summand { shape, sign: Sign::Positive, beside, ..Summand::default() })
    }
}

lacuna::register!(Term, "pull", Pull);
