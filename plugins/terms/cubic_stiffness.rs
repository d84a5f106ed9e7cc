//! `cubic_stiffness`: a hardening or softening spring.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{deflection, of, of_each};

/// Cubic stiffness: a spring that hardens (coefficient above zero) or softens (below zero).
///
/// ```text
/// rate = … - coefficient u³
/// ```
///
/// The spring of the Duffing oscillator (Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, 1918):
/// the frequency depends on the amplitude.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CubicStiffness {
    /// Deflection `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Equilibrium from which the deflection counts, as an expression such as `"0.05 {m}"` or `"mass * 9.81 {m/s2} /
    /// stiffness"`. Default: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<String>,
}

impl Component for CubicStiffness {}

impl Term for CubicStiffness {
    fn describe(&self) -> Description {
        Description {
            title: "cubic stiffness: a spring that hardens or softens".into(),
            formula: "- coefficient * u^3".into(),
            source: "Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz (1918)"
                .into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        if site.positions.is_empty() {
            return std::iter::once(Table::new()).chain(of_each(site.others)).collect();
        }
        of_each(site.positions).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = deflection(of(self.of.as_deref(), place), self.about.as_deref());
        Ok(Summand { shape: format!("-({u})^3"), sign: Sign::Either, ..Summand::default() })
    }
}

lacuna::register!(Term, "cubic_stiffness", CubicStiffness);
