//! `bouc_wen`: hysteresis of a restoring force.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::State;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{deflection_index, magnitude, of, unit_of};

/// Bouc-Wen hysteresis: a restoring force that depends on the path of the deflection.
///
/// ```text
/// rate = … - coefficient z,   z' = (u - 0.5 (abs(u) abs(z)^(power - 1) z + u abs(z)^power)) / deflection
/// ```
///
/// The coefficient, at least zero, is the force at which the element yields, `deflection` the deflection at which it does, and
/// `power` the sharpness of the yield. The shares 0.5 of both summands are those of elastic unloading (Wen 1976). It
/// starts at rest, `z = 0`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoucWen {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Prior of the deflection at yield, in the unit of `u` times that of the time. Default: log-uniform from 0.05 to 5
    /// times the size of the deflection, which is estimated from the speed and its rate along the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deflection: Option<Distribution>,
    /// Prior of the power. Default: uniform from 1 to 4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<Distribution>,
}

impl Component for BoucWen {}

impl Term for BoucWen {
    fn describe(&self) -> Description {
        Description {
            title: "Bouc-Wen hysteresis: a restoring force that depends on the path".into(),
            formula: "- coefficient * z with z' = (u - 0.5 * (abs(u) * abs(z)^(power - 1) * z + u * abs(z)^power)) / deflection".into(),
            source: "Bouc (1967); Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        if site.springs().is_empty() { Vec::new() } else { vec![Table::new()] }
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let unit = unit_of(self.unit.as_ref(), self.of.as_deref(), place)?;
        let (z, power) = (format!("{}_z", place.name), format!("{}_power", place.name));
        let deflection = deflection_index(self.deflection.as_ref(), place, u, unit, [0.05, 5.0])?;
        let prior = self.power.clone().unwrap_or(Distribution::Uniform([1.0, 4.0]));
        let starts = [0.2, 0.7].map(|p| prior.quantile(p)).to_vec();
        let size = |exponent: &str| magnitude(&z, "1", exponent);
        let rate = format!(
            "(({u}) - 0.5 * (abs({u}) * {} * {z} + ({u}) * {})) / {}",
            size(&format!("{power} - 1")),
            size(&power),
            deflection.name
        );
        Ok(Summand {
            shape: format!("-{z}"),
            sign: Sign::Positive,
            indices: vec![
                deflection,
                Index { name: power, unit: Unit::dimensionless(), prior, starts },
            ],
            states: vec![State { name: z, rate, start: "0".into(), ..State::default() }],
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "bouc_wen", BoucWen);
