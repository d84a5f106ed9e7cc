//! `carreau_friction`: a drag that bends from a linear law to a power of the speed.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{of, of_quantities, of_quantity, range, scale, unit_of};

/// Friction that bends: linear for slow motion, a power of the speed for fast motion. With a power below 1 the drag or loss
/// levels off, with a power of 2 it turns from viscous to turbulent.
///
/// ```text
/// rate = … - coefficient u ((1 + (u / bend)²) / (1 + (scale / bend)²))^((power - 1) / 2),   coefficient ≥ 0
/// ```
///
/// This is Carreau's law of shear-thinning liquids, in the speed `u`. With power 1 it is `linear_friction`; with a small
/// `bend` it is `power_friction`, with power 2 `quadratic_friction`, with power 0 `coulomb_friction`. The `scale` is the root
/// mean square of `u` along the run, so that the coefficient is the damping at that speed. Without being told, a search
/// proposes it for the difference to the surroundings where the rate has such a difference, as in the heat loss of a body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CarreauFriction {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Prior of the power for fast motion. Default: uniform from 0 to 3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<Distribution>,
    /// Prior of the speed at which the law bends, in the unit of `u`. Default: log-uniform from 0.1 to 3 times the root mean
    /// square of `u` along the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend: Option<Distribution>,
}

impl Component for CarreauFriction {}

impl Term for CarreauFriction {
    fn describe(&self) -> Description {
        Description {
            title: "friction that bends from a linear law to a power of the speed".into(),
            formula:
                "- coefficient * u * ((1 + (u / bend)^2) / (1 + (scale / bend)^2))^((power - 1) / 2)"
                    .into(),
            source: "Carreau, Trans. Soc. Rheology 16 (1972) 99".into(),
        }
    }

    fn contains(&self) -> &'static [&'static str] {
        &["linear_friction", "quadratic_friction", "power_friction", "coulomb_friction"]
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        let state = site.state;
        let difference = |at: &str| of_quantity(&format!("{} - ({at})", state.name), &state.unit);
        let differences: Vec<Table> = site.references().map(difference).collect();
        if !differences.is_empty() {
            return differences;
        }
        std::iter::once(Table::new()).chain(of_quantities(site.others)).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let unit = unit_of(self.unit.as_ref(), self.of.as_deref(), place)?;
        let (power, bend) = (format!("{}_power", place.name), format!("{}_bend", place.name));
        let scale = scale(place, u, unit)?;
        let of_power = self.power.clone().unwrap_or(Distribution::Uniform([0.0, 3.0]));
        let of_bend = range(self.bend.as_ref(), place, u, [0.1, 3.0])?;
        let starts =
            |prior: &Distribution, at: &[f64]| at.iter().map(|p| prior.quantile(*p)).collect();
        let bent = |x: &str| format!("(1 + (({x}) / {bend})^2)");
        Ok(Summand {
            shape: format!("-({u}) * ({} / {})^(0.5 * ({power} - 1))", bent(u), bent(&scale)),
            sign: Sign::Positive,
            scale: Some(format!("({u})")),
            fixed: Some(format!("scale = {scale}")),
            indices: vec![
                Index {
                    starts: starts(&of_power, &[0.1, 0.6]),
                    name: power.clone(),
                    unit: Unit::dimensionless(),
                    prior: of_power,
                },
                Index {
                    starts: starts(&of_bend, &[0.25, 0.75]),
                    name: bend.clone(),
                    unit: unit.clone(),
                    prior: of_bend,
                },
            ],
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "carreau_friction", CarreauFriction);
