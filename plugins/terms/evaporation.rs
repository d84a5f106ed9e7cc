//! `evaporation`: a heat loss driven by the vapour pressure.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::of;

/// Evaporation: a heat loss in proportion to the excess vapour pressure, which grows exponentially with the
/// temperature.
///
/// ```text
/// rate = … - coefficient (exp((u - ambient) / scale) - 1),   coefficient ≥ 0
/// ```
///
/// Dalton's law with the vapour pressure of Clausius and Clapeyron, linearised in its exponent about the temperature
/// of saturated surroundings: for water the pressure increases by a factor of e about every 16 K at 20 degrees
/// Celsius, and every 21 K at 60.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Evaporation {
    /// Temperature `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Temperature of the surroundings, as an expression such as `"293 {K}"`.
    pub ambient: String,
    /// Temperature difference over which the vapour pressure increases by a factor of e, as an expression such as
    /// `"16 {K}"`.
    pub scale: String,
}

impl Component for Evaporation {}

impl Term for Evaporation {
    fn describe(&self) -> Description {
        Description {
            title: "evaporation: a loss with the vapour pressure".into(),
            formula: "- coefficient * (exp((u - ambient) / scale) - 1)".into(),
            source: "Dalton, Mem. Lit. Phil. Soc. Manchester 5 (1802) 535".into(),
        }
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let (u, ambient, scale) = (of(self.of.as_deref(), place), &self.ambient, &self.scale);
        let shape = format!("1 - exp((({u}) - ({ambient})) / ({scale}))");
        Ok(Summand { shape, sign: Sign::Positive, ..Summand::default() })
    }
}

lacuna::register!(Term, "evaporation", Evaporation);
