//! `dead_zone`: a force that is absent within a gap.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{clamped, of, of_inputs, of_quantities, quantity, share, size, unit_of};

/// Dead zone: free play or backlash, within which a force of the model is absent.
///
/// ```text
/// rate = … + coefficient clamp(u, -gap, gap),   coefficient ≥ 0
/// ```
///
/// If the model has the force `-coefficient u`, the sum acts only on what exceeds the gap. `clamp` limits the quantity to
/// the gap on both sides, with a bend of a small `width`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeadZone {
    /// Quantity `u` that has free play, such as the deflection `"x"` in the rate of a velocity, as an
    /// expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Prior of the half width of the gap, in the unit of `u`. Default: uniform from 0 to 2 times the root mean square of
    /// `u` along the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<Distribution>,
}

impl Component for DeadZone {}

impl Term for DeadZone {
    fn describe(&self) -> Description {
        Description {
            title: "a dead zone: free play or backlash without a force".into(),
            formula: "coefficient * clamp(u, -gap, gap)".into(),
            source: "standard: piecewise linear restoring force (Shaw and Holmes, J. Sound Vib. 90 (1983) 129)".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        of_quantities(&site.springs()).chain(of_inputs(site)).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let unit = unit_of(self.unit.as_ref(), self.of.as_deref(), place)?;
        let gap = format!("{}_gap", place.name);
        let prior = share(self.gap.as_ref(), place, u, [0.0, 2.0])?;
        let starts = [0.1, 0.3, 0.5, 0.7, 0.9].map(|p| prior.quantile(p)).to_vec();
        let width = quantity(0.01 * size(place, u)?, unit);
        Ok(Summand {
            shape: clamped(u, &gap, &width),
            sign: Sign::Positive,
            indices: vec![Index { name: gap, unit: unit.clone(), prior, starts }],
            scale: Some(format!("({u})")),
            fixed: Some(format!("width = {width}")),
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "dead_zone", DeadZone);
