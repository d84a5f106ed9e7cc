//! `power_friction`: a drag with an unknown power of the speed.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{of_quantities, power_law};

/// Power-law friction: a drag with a power of the speed that is inferred.
///
/// ```text
/// rate = … - coefficient u (abs(u) / scale)^(power - 1),   coefficient ≥ 0
/// ```
///
/// With power 1 it is `linear_friction`, with power 2 `quadratic_friction`; blunt bodies between creeping and turbulent
/// flow, rotors and porous media lie between. The `scale` is the root mean square of `u` along the run, so that the
/// coefficient is the damping at that speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerFriction {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Prior of the power. Default: uniform from 0.2 to 3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<Distribution>,
}

impl Component for PowerFriction {}

impl Term for PowerFriction {
    fn describe(&self) -> Description {
        Description {
            title: "power-law friction: a drag with an unknown power of the speed".into(),
            formula: "- coefficient * u * (abs(u) / scale)^(power - 1)".into(),
            source: "standard: power-law drag, as in White, Fluid Mechanics, chapter 7".into(),
        }
    }

    fn contains(&self) -> &'static [&'static str] {
        &["linear_friction", "quadratic_friction"]
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        std::iter::once(Table::new()).chain(of_quantities(site.others)).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let argument = (self.of.as_deref(), self.unit.as_ref());
        let law = power_law(place, argument, self.power.as_ref(), [0.2, 3.0])?;
        Ok(Summand { sign: Sign::Positive, ..law })
    }
}

lacuna::register!(Term, "power_friction", PowerFriction);
