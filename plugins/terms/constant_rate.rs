//! `constant_rate`: a rate that depends on nothing.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// Constant rate: a bias force, a leak or a supply that depends neither on the state nor on the time.
///
/// ```text
/// rate = … + coefficient
/// ```
///
/// The coefficient may have either sign. In a velocity the term is a force such as that of an inclined track or of an
/// amplifier's offset: it shifts the equilibrium of an oscillator, and lets the speed of a damped drive settle at
/// another value. In a level or a temperature it is a steady gain or loss.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstantRate {}

impl Component for ConstantRate {}

impl Term for ConstantRate {
    fn describe(&self) -> Description {
        Description {
            title: "constant rate: a bias force, a leak or a supply".into(),
            formula: "+ coefficient".into(),
            source: "standard: balance equations".into(),
        }
    }

    fn proposals(&self, _: &Site<'_>) -> Vec<Table> {
        vec![Table::new()]
    }

    fn summand(&self, _: &Place<'_>) -> Result<Summand, String> {
        Ok(Summand { shape: "1".into(), sign: Sign::Either, ..Summand::default() })
    }
}

lacuna::register!(Term, "constant_rate", ConstantRate);
