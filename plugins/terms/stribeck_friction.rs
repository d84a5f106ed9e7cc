//! `stribeck_friction`: dry friction that is larger near rest.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{of, range, unit_of, width};

/// Stribeck friction: dry friction that falls from a larger value near rest to the Coulomb value at speed.
///
/// ```text
/// rate = … - coefficient (1 + rise exp(-(u / speed)²)) tanh(u / width),   coefficient ≥ 0
/// ```
///
/// The friction of lubricated contacts (Stribeck 1902) in the form of Bo and Pavelescu. `rise` is the excess of the
/// friction near rest over that at speed. Without `rise` it is `coulomb_friction`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StribeckFriction {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Speed over which the sign is smoothed, as an expression such as `"0.01 {m/s}"`. Default: the change of the state
    /// within one step of the response.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width: Option<String>,
    /// Prior of the rise. Default: uniform from 0 to 3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rise: Option<Distribution>,
    /// Prior of the speed at which the rise vanishes, in the unit of `u`. Default: log-uniform from 0.05 to 1 times the
    /// root mean square of `u` along the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed: Option<Distribution>,
}

impl Component for StribeckFriction {}

impl Term for StribeckFriction {
    fn describe(&self) -> Description {
        Description {
            title: "Stribeck friction: dry friction that is larger near rest".into(),
            formula: "- coefficient * (1 + rise * exp(-(u / speed)^2)) * tanh(u / width)".into(),
            source: "Stribeck, Z. VDI 46 (1902) 1341; Bo and Pavelescu, Wear 82 (1982) 277".into(),
        }
    }

    fn contains(&self) -> &'static [&'static str] {
        &["coulomb_friction"]
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        // The sign of a speed near rest matters where a position shows it.
        if site.positions.is_empty() { Vec::new() } else { vec![Table::new()] }
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let unit = unit_of(self.unit.as_ref(), self.of.as_deref(), place)?;
        let (rise, speed) = (format!("{}_rise", place.name), format!("{}_speed", place.name));
        let (width, fixed) = width(self.width.as_deref(), self.of.as_deref(), place)?;
        let of_rise = self.rise.clone().unwrap_or(Distribution::Uniform([0.0, 3.0]));
        let of_speed = range(self.speed.as_ref(), place, u, [0.05, 1.0])?;
        let starts = |prior: &Distribution| [0.25, 0.75].map(|p| prior.quantile(p)).to_vec();
        let index = |name: &str, unit: &Unit, prior: Distribution| Index {
            name: name.to_owned(),
            unit: unit.clone(),
            starts: starts(&prior),
            prior,
        };
        Ok(Summand {
            shape: format!("-(1 + {rise} * exp(-(({u}) / {speed})^2)) * tanh(({u}) / ({width}))"),
            sign: Sign::Positive,
            indices: vec![
                index(&rise, &Unit::dimensionless(), of_rise),
                index(&speed, unit, of_speed),
            ],
            fixed,
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "stribeck_friction", StribeckFriction);
