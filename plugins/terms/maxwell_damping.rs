//! `maxwell_damping`: a spring and a damper in series.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::State;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{deflection_of, deflection_unit, of, unit_of};

/// Maxwell element: a spring and a damper in series, a force that relaxes.
///
/// ```text
/// rate = … - coefficient z,   z' = u - z / time,   coefficient ≥ 0
/// ```
///
/// Against motions much faster than the relaxation `time` it is a spring of stiffness `coefficient`, against slow ones a
/// damper of `coefficient time`: rubber mounts, hydraulic bushings, air chambers. The element starts without
/// deflection, `z = 0`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaxwellDamping {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Prior of the relaxation time, in the unit of the time. Default: log-uniform from one step to the duration of the
    /// response.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<Distribution>,
}

impl Component for MaxwellDamping {}

impl Term for MaxwellDamping {
    fn describe(&self) -> Description {
        Description {
            title: "a Maxwell element: a spring and a damper in series".into(),
            formula: "- coefficient * z with z' = u - z / time".into(),
            source: "Maxwell, Phil. Trans. 157 (1867) 49".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        if site.springs().is_empty() { Vec::new() } else { vec![Table::new()] }
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let time = place.time.ok_or("the model has no time")?;
        let u = of(self.of.as_deref(), place);
        let unit = unit_of(self.unit.as_ref(), self.of.as_deref(), place)?;
        let (z, relaxation) = (format!("{}_z", place.name), format!("{}_time", place.name));
        let longest = time.duration.max(2.0 * time.step);
        let prior = self.time.clone().unwrap_or(Distribution::LogUniform([time.step, longest]));
        let starts = [0.15, 0.4, 0.65, 0.9].map(|p| prior.quantile(p)).to_vec();
        let unit = deflection_unit(place, unit)?;
        let rate = format!("({u}) - {z} / {relaxation}");
        Ok(Summand {
            shape: format!("-{z}"),
            sign: Sign::Positive,
            scale: Some(deflection_of(place, u, &unit)?),
            indices: vec![Index { name: relaxation, unit: time.unit.clone(), prior, starts }],
            states: vec![State { name: z, unit, rate, start: "0".into(), ..State::default() }],
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "maxwell_damping", MaxwellDamping);
