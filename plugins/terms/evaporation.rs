//! `evaporation`: a heat loss driven by the vapour pressure.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{ambient, ambient_each, of, scale};

/// Evaporation: a heat loss in proportion to the excess vapour pressure, which grows exponentially with the
/// temperature.
///
/// ```text
/// rate = … - coefficient (exp((u - ambient) / scale) - 1),   coefficient ≥ 0
/// ```
///
/// If the scale is unknown, the coefficient is the loss at a temperature difference `D`, the size of `u - ambient` along the run:
/// data determine it whatever the scale is.
///
/// ```text
/// rate = … - coefficient (exp((u - ambient) / scale) - 1) / (exp(D / scale) - 1)
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
    /// Temperature of the surroundings, as an expression such as `"293 {K}"`. Default: the only quantity that the rate
    /// subtracts from the state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ambient: Option<String>,
    /// Temperature difference over which the vapour pressure increases by a factor of e, as an expression such as
    /// `"16 {K}"`. Default: an unknown, log-uniform from 8 to 40 K.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<String>,
}

/// The bounds of an unknown scale, in kelvin: those of water between 0 and 100 degrees Celsius are 14 and 28.
const BOUNDS: [f64; 2] = [8.0, 40.0];

/// The scales from which a search starts, in kelvin.
const STARTS: [f64; 3] = [12.0, 18.0, 27.0];

/// The scale as an unknown.
fn unknown(name: &str) -> Result<Index, String> {
    let unit = Unit::parse("K").map_err(|error| error.to_string())?;
    let prior = Distribution::LogUniform(BOUNDS);
    Ok(Index { name: format!("{name}_scale"), unit, prior, starts: STARTS.to_vec() })
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

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        ambient_each(site)
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let ambient = ambient(self.ambient.as_deref(), place)?;
        let difference = format!("({u}) - ({ambient})");
        if let Some(scale) = &self.scale {
            let shape = format!("1 - exp(({difference}) / ({scale}))");
            return Ok(Summand { shape, sign: Sign::Positive, ..Summand::default() });
        }
        let index = unknown(place.name)?;
        let reference = scale(place, &difference, &place.state.unit.difference())?;
        let excess = |of: &str| format!("(exp(({of}) / {}) - 1)", index.name);
        Ok(Summand {
            shape: format!("-{} / {}", excess(&difference), excess(&reference)),
            sign: Sign::Positive,
            indices: vec![index],
            fixed: Some(format!("D = {reference}")),
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "evaporation", Evaporation);
