//! `quadratic_stiffness`: a restoring force with the square of the deflection.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{deflection, of, of_each};

/// Quadratic stiffness: a restoring force that differs between the two directions.
///
/// ```text
/// rate = … - coefficient u²
/// ```
///
/// The coefficient may have either sign. The term shifts the mean position of an oscillation and adds its second
/// harmonic (Nayfeh and Mook, Nonlinear Oscillations, 1979, section 2.2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuadraticStiffness {
    /// Deflection `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Equilibrium from which the deflection counts, as an expression such as `"0.05 {m}"` or `"mass * 9.81 {m/s2} /
    /// stiffness"`. Default: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<String>,
}

impl Component for QuadraticStiffness {}

impl Term for QuadraticStiffness {
    fn describe(&self) -> Description {
        Description {
            title: "quadratic stiffness: a restoring force that differs between the two directions"
                .into(),
            formula: "- coefficient * u^2".into(),
            source: "Nayfeh and Mook, Nonlinear Oscillations (1979), section 2.2".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        of_each(site.positions).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = deflection(of(self.of.as_deref(), place), self.about.as_deref());
        Ok(Summand { shape: format!("-({u})^2"), sign: Sign::Either, ..Summand::default() })
    }
}

lacuna::register!(Term, "quadratic_stiffness", QuadraticStiffness);
