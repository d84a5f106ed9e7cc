//! `power_stiffness`: a spring with an unknown power of the deflection.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{magnitude, of, of_quantities, scale, unit_of};

/// Power-law stiffness: a spring that hardens (coefficient above zero) or softens with a power that is inferred.
///
/// ```text
/// rate = … - coefficient u (abs(u) / scale)^(power - 1)
/// ```
///
/// With power 3 it is `cubic_stiffness`. Contacts have a power of 3/2 (Hertz), membranes of 3, stops a high one. The
/// `scale` is the root mean square of `u` along the run, so that the coefficient is the stiffness at that deflection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerStiffness {
    /// Deflection `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Prior of the power. Default: uniform from 1.2 to 7.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<Distribution>,
}

impl Component for PowerStiffness {}

impl Term for PowerStiffness {
    fn describe(&self) -> Description {
        Description {
            title: "power-law stiffness: a spring with an unknown power of the deflection".into(),
            formula: "- coefficient * u * (abs(u) / scale)^(power - 1)".into(),
            source: "Nayfeh and Mook, Nonlinear Oscillations (1979), section 2.3".into(),
        }
    }

    fn contains(&self) -> &'static [&'static str] {
        &["cubic_stiffness"]
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        of_quantities(site.positions).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let power = format!("{}_power", place.name);
        let prior = self.power.clone().unwrap_or(Distribution::Uniform([1.2, 7.0]));
        let starts = [0.15, 0.5, 0.85].map(|p| prior.quantile(p)).to_vec();
        let scale = scale(place, u, unit_of(self.unit.as_ref(), self.of.as_deref(), place)?)?;
        let magnitude = magnitude(u, &scale, &format!("{power} - 1"));
        Ok(Summand {
            shape: format!("-({u}) * {magnitude}"),
            sign: Sign::Either,
            indices: vec![Index { name: power, unit: Unit::dimensionless(), prior, starts }],
            scale: Some(format!("({u})")),
            fixed: Some(format!("scale = {scale}")),
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "power_stiffness", PowerStiffness);
