//! `convection`: a heat loss with a power of the temperature difference.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use lacuna::text::values::Positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{ambient, ambient_each, magnitude, of, scale};

fn laminar() -> Positive {
    Positive::new(1.25).unwrap_or_else(|_| unreachable!("1.25 is positive"))
}

/// Natural convection: a heat loss with a power above one of the temperature difference.
///
/// ```text
/// rate = … - coefficient (u - ambient) (abs(u - ambient) / scale)^(power - 1),   coefficient ≥ 0
/// ```
///
/// The heat transfer of a laminar boundary layer at a wall grows with the difference to the power 1/4, the loss with the
/// power 5/4; a turbulent one has 4/3. The `scale` is the root mean square of the difference along the run, so that the
/// coefficient is the rate of loss at that difference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Convection {
    /// Temperature `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Temperature of the surroundings, as an expression such as `"20 {degC}"`. Default: the only quantity that the rate
    /// subtracts from the state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ambient: Option<String>,
    /// Power of the temperature difference.
    #[serde(default = "laminar")]
    pub power: Positive,
}

impl Component for Convection {}

impl Term for Convection {
    fn describe(&self) -> Description {
        Description {
            title: "natural convection: a loss with a power of the temperature difference".into(),
            formula: "- coefficient * (u - ambient) * (abs(u - ambient) / scale)^(power - 1)"
                .into(),
            source: "McAdams, Heat Transmission (1954), chapter 7".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        ambient_each(site)
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let ambient = ambient(self.ambient.as_deref(), place)?;
        let difference = format!("({u}) - ({ambient})");
        let scale = scale(place, &difference, &place.state.unit.difference())?;
        let power = self.power.get() - 1.0;
        let magnitude = magnitude(&difference, &scale, &format!("{power:?}"));
        Ok(Summand {
            shape: format!("-({difference}) * {magnitude}"),
            sign: Sign::Positive,
            fixed: Some(format!("scale = {scale}")),
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "convection", Convection);
