//! `quadratic_friction`: a drag that grows with the square of the speed.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{of, of_each};

/// Quadratic friction: a drag in proportion to the square of the speed, opposed to it.
///
/// ```text
/// rate = … - coefficient u |u|,   coefficient ≥ 0
/// ```
///
/// The drag of blunt bodies at large Reynolds numbers (Newton, Principia, book II, section VII). It is easily
/// confused with `linear_friction` if the speed varies little.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuadraticFriction {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
}

impl Component for QuadraticFriction {}

impl Term for QuadraticFriction {
    fn describe(&self) -> Description {
        Description {
            title: "quadratic friction: a drag with the square of the speed".into(),
            formula: "- coefficient * u * abs(u)".into(),
            source: "Newton, Principia (1687), book II, section VII".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        std::iter::once(Table::new()).chain(of_each(site.others)).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        Ok(Summand {
            shape: format!("-({u}) * abs({u})"),
            sign: Sign::Positive,
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "quadratic_friction", QuadraticFriction);
