//! `radiation`: a heat loss with the fourth power of the temperature.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{ambient, ambient_each, of};

/// Radiation: a heat loss with the fourth power of the absolute temperature.
///
/// ```text
/// rate = … - coefficient (u⁴ - ambient⁴),   coefficient ≥ 0
/// ```
///
/// The Stefan-Boltzmann law, with exchange in both directions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Radiation {
    /// Absolute temperature `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Absolute temperature of the surroundings, as an expression such as `"293 {K}"`. Default: the only quantity that the rate
    /// subtracts from the state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ambient: Option<String>,
}

impl Component for Radiation {}

impl Term for Radiation {
    fn describe(&self) -> Description {
        Description {
            title: "radiation: a loss with the fourth power of the temperature".into(),
            formula: "- coefficient * (u^4 - ambient^4)".into(),
            source: "Boltzmann, Annalen der Physik 258 (1884) 291".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        // The fourth power is that of an absolute temperature.
        let is_absolute = site.state.unit == site.state.unit.difference();
        if is_absolute { ambient_each(site) } else { Vec::new() }
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let ambient = ambient(self.ambient.as_deref(), place)?;
        let shape = format!("({ambient})^4 - ({u})^4");
        Ok(Summand { shape, sign: Sign::Positive, ..Summand::default() })
    }
}

lacuna::register!(Term, "radiation", Radiation);
