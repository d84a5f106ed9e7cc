//! `dahl_friction`: dry friction with presliding.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::State;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{deflection_index, of, unit_of};

/// Dahl friction: dry friction of a contact that yields elastically before it slides.
///
/// ```text
/// rate = … - coefficient z,   z' = (u - abs(u) z) / deflection,   coefficient ≥ 0
/// ```
///
/// The state `z` follows the sign of the speed over a sliding distance `deflection`; a small one is
/// `coulomb_friction`. The model of Dahl (1968) with exponent one; it starts at rest, `z = 0`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DahlFriction {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Prior of the sliding distance, in the unit of `u` times that of the time. Default: log-uniform from 0.02 to 2 times
    /// the size of the deflection, which is estimated from the speed and its rate along the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deflection: Option<Distribution>,
}

impl Component for DahlFriction {}

impl Term for DahlFriction {
    fn describe(&self) -> Description {
        Description {
            title: "Dahl friction: dry friction that yields before it slides".into(),
            formula: "- coefficient * z with z' = (u - abs(u) * z) / deflection".into(),
            source: "Dahl, A solid friction model, Aerospace Corporation TOR-0158 (1968)".into(),
        }
    }

    fn contains(&self) -> &'static [&'static str] {
        &["coulomb_friction"]
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        if site.positions.is_empty() { Vec::new() } else { vec![Table::new()] }
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let unit = unit_of(self.unit.as_ref(), self.of.as_deref(), place)?;
        let (z, index) = (
            format!("{}_z", place.name),
            deflection_index(self.deflection.as_ref(), place, u, unit, [0.02, 2.0])?,
        );
        let rate = format!("(({u}) - abs({u}) * {z}) / {}", index.name);
        Ok(Summand {
            shape: format!("-{z}"),
            sign: Sign::Positive,
            indices: vec![index],
            states: vec![State { name: z, rate, start: "0".into(), ..State::default() }],
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "dahl_friction", DahlFriction);
