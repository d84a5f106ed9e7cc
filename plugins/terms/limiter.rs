//! `limiter`: stops on both sides, or saturation.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{clamped, of, of_inputs, of_quantities, quantity, share, size, unit_of};

/// Limiter: a limit on both sides, such as stops of a deflection, saturation of an actuator.
///
/// ```text
/// rate = … - coefficient (u - clamp(u, -limit, limit)),   coefficient ≥ 0
/// ```
///
/// The summand is zero within the limit and opposes what exceeds it. If the model has the force `coefficient u` of an
/// actuator, the sum is that of an actuator that saturates; a large coefficient on a deflection is a stop on either side.
/// `overflow` acts on one side only. The bend at the limit has a small `width`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limiter {
    /// Quantity `u` that is limited, such as the deflection `"x"` in the rate of a velocity or a
    /// force `"force(t)"`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Prior of the limit, in the unit of `u`. Default: uniform from 0.2 to 3 times the root mean square of `u` along the
    /// run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<Distribution>,
}

impl Component for Limiter {}

impl Term for Limiter {
    fn describe(&self) -> Description {
        Description {
            title: "a limiter: stops on both sides, or saturation of an actuator".into(),
            formula: "- coefficient * (u - clamp(u, -limit, limit))".into(),
            source: "standard: piecewise linear restoring force (Shaw and Holmes, J. Sound Vib. 90 (1983) 129)".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        of_quantities(site.positions).chain(of_inputs(site)).collect()
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let unit = unit_of(self.unit.as_ref(), self.of.as_deref(), place)?;
        let limit = format!("{}_limit", place.name);
        let prior = share(self.limit.as_ref(), place, u, [0.2, 3.0])?;
        let starts = [0.1, 0.25, 0.4, 0.55, 0.7, 0.85].map(|p| prior.quantile(p)).to_vec();
        let width = quantity(0.01 * size(place, u)?, unit);
        let clamped = clamped(u, &limit, &width);
        Ok(Summand {
            shape: format!("{clamped} - ({u})"),
            sign: Sign::Positive,
            indices: vec![Index { name: limit, unit: unit.clone(), prior, starts }],
            scale: Some(format!("({u})")),
            fixed: Some(format!("width = {width}")),
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "limiter", Limiter);
