//! `fractional_damping`: a damping with a derivative of fractional order.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::State;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::{deflection_of, deflection_unit, of, quantity, unit_of};

/// Number of rates of the diffusive representation: about two in a decade for a response of some hundred points.
const RATES: usize = 10;

/// Fractional damping: a force in proportion to a derivative of the deflection of an order between zero (a spring) and
/// one (a damper).
///
/// ```text
/// rate = … - coefficient D^order ∫u dt / reference^order,   coefficient ≥ 0
/// ```
///
/// Polymers and soft tissue damp so over decades of frequency. The derivative of Caputo is written as its diffusive
/// representation, `sin(π order)/π ∫ ξ^(order - 1) z(ξ) dξ` with `z' = u - ξ z`, at ten rates ξ in equal ratios, from a
/// thirtieth of the inverse duration of the response to three times its sampling rate; slower and faster rates act as a
/// spring and as a damper. The `reference` is the geometric mean of these rates, so that the coefficient is the stiffness at
/// that rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FractionalDamping {
    /// Speed `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Unit of `u`. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Prior of the order. Default: uniform from 0.1 to 0.9.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<Distribution>,
}

impl Component for FractionalDamping {}

impl Term for FractionalDamping {
    fn describe(&self) -> Description {
        Description {
            title: "fractional damping: a derivative of an order between zero and one".into(),
            formula: "- coefficient * D^order of the deflection / reference^order".into(),
            source: "Bagley and Torvik, AIAA J. 21 (1983) 741; Diethelm, Numer. Algorithms 47 (2008) 361".into(),
        }
    }

    fn proposals(&self, site: &Site<'_>) -> Vec<Table> {
        if site.springs().is_empty() { Vec::new() } else { vec![Table::new()] }
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let time = place.time.ok_or("the model has no time")?;
        let u = of(self.of.as_deref(), place);
        let unit = unit_of(self.unit.as_ref(), self.of.as_deref(), place)?;
        let unit = deflection_unit(place, unit)?;
        let per_time = time.unit.power(-1.0).ok_or("the time has no unit that can be inverted")?;
        let order = format!("{}_order", place.name);
        let (low, high) = (1.0 / (30.0 * time.duration), 3.0 / time.step);
        let ratio = (high / low).ln() / (RATES - 1) as f64;
        let state = |k: usize| format!("{}_z{}", place.name, k + 1);
        let prior = self.order.clone().unwrap_or(Distribution::Uniform([0.1, 0.9]));
        let starts = [0.25, 0.75].map(|p| prior.quantile(p)).to_vec();
        let states = (0..RATES).map(|k| {
            let rate = quantity(low * (ratio * k as f64).exp(), &per_time);
            State {
                name: state(k),
                unit: unit.clone(),
                rate: format!("({u}) - {rate} * {}", state(k)),
                start: "0".into(),
                ..State::default()
            }
        });
        // The rates relative to their geometric mean are powers of the ratio about zero.
        let exponent = |k: usize| ratio * (k as f64 - 0.5 * (RATES - 1) as f64);
        // Beyond the ends the weights are geometric series: slower rates follow the deflection as the first does, faster ones the
        // speed in inverse proportion to their rate.
        let part = |k: usize| {
            let weight = format!("exp({order} * {:?})", exponent(k));
            match k {
                0 => format!("{weight} * (1 + 1 / expm1({order} * {ratio:?})) * {}", state(k)),
                k if k == RATES - 1 => {
                    format!("{weight} * (1 + 1 / expm1((1 - {order}) * {ratio:?})) * {}", state(k))
                }
                k => format!("{weight} * {}", state(k)),
            }
        };
        let parts: Vec<String> = (0..RATES).map(part).collect();
        Ok(Summand {
            shape: format!("-(sin(pi * {order}) / pi * {ratio:?} * ({}))", parts.join(" + ")),
            sign: Sign::Positive,
            scale: Some(deflection_of(place, u, &unit)?),
            indices: vec![Index { name: order, unit: Unit::dimensionless(), prior, starts }],
            states: states.collect(),
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "fractional_damping", FractionalDamping);
