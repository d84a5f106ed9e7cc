//! `coulomb_friction`: dry friction, independent of the magnitude of the speed.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{of, width};

/// Coulomb friction: dry friction, opposed to the speed and independent of its magnitude.
///
/// ```text
/// rate = … - coefficient tanh(u / width),   coefficient ≥ 0
/// ```
///
/// The sign of the speed is smoothed over `width`, which governs how the speed passes through zero and which data
/// rarely determine. Without `width` it is a twentieth of the change of the speed within one step of the response, and
/// the candidate's formula says so. The term is easily confused with `linear_friction` if the amplitude varies little.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CoulombFriction {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Speed over which the sign is smoothed, as an expression such as `"0.01 {m/s}"`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width: Option<String>,
}

impl Component for CoulombFriction {}

impl Term for CoulombFriction {
    fn describe(&self) -> Description {
        Description {
            title: "Coulomb friction: dry friction, as large at any speed".into(),
            formula: "- coefficient * tanh(u / width)".into(),
            source: "Coulomb, Théorie des machines simples (1785)".into(),
        }
    }

    fn proposals(&self, _: &Site<'_>) -> Vec<Table> {
        vec![Table::new()]
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let (width, fixed) = width(self.width.as_deref(), self.of.as_deref(), place)?;
        let shape = format!("-tanh(({u}) / ({width}))");
        Ok(Summand { shape, sign: Sign::Positive, fixed, ..Summand::default() })
    }
}

lacuna::register!(Term, "coulomb_friction", CoulombFriction);
