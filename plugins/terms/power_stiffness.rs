//! `power_stiffness`: a spring with an unknown power of the deflection.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{of_quantities, power_law};

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
        let argument = (self.of.as_deref(), self.unit.as_ref());
        let law = power_law(place, argument, self.power.as_ref(), [1.2, 7.0])?;
        Ok(Summand { sign: Sign::Either, ..law })
    }
}

lacuna::register!(Term, "power_stiffness", PowerStiffness);
