//! `linear_friction`: a drag that grows with the speed.

use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{of, of_each};

/// Linear friction: a drag in proportion to the speed.
///
/// ```text
/// rate = … - coefficient u,   coefficient ≥ 0
/// ```
///
/// Viscous dashpots and creeping flow (Stokes, Trans. Camb. Phil. Soc. 9 (1851) 8). It is easily confused with
/// `quadratic_friction` if the speed varies little, and with `relaxation` towards zero, which has the same form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinearFriction {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
}

impl Component for LinearFriction {}

impl Term for LinearFriction {
    fn describe(&self) -> Description {
        Description {
            title: "linear friction: a drag in proportion to the speed".into(),
            formula: "- coefficient * u".into(),
            source: "Stokes, Trans. Camb. Phil. Soc. 9 (1851) 8".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        std::iter::once(Table::new()).chain(of_each(site.others)).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        Ok(Summand { shape: format!("-({u})"), sign: Sign::Positive, ..Summand::default() })
    }
}

lacuna::register!(Term, "linear_friction", LinearFriction);
