//! `forcing`: a periodic force.

use std::f64::consts::PI;

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Sign, Site, Summand};
use lacuna::plugin::{Component, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

/// Maximum number of frequencies from which a search starts.
const MOST: usize = 48;

/// Periodic forcing: a sinusoidal excitation that the model lacks.
///
/// ```text
/// rate = … + coefficient cos(2 π frequency t + phase)
/// ```
///
/// By default the search covers the frequencies from 0.75 to 12 oscillations over the response, in steps that change
/// the phase at the end of the response by half an oscillation; `frequency` sets another range.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Forcing {
    /// Prior of the frequency, in oscillations per unit of the time. Default: uniform from 0.75 to 12 oscillations
    /// over the response, but at most one oscillation per two steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency: Option<Distribution>,
}

impl Component for Forcing {}

impl Term for Forcing {
    fn describe(&self) -> Description {
        Description {
            title: "forcing at a frequency".into(),
            formula: "coefficient * cos(2 * pi * frequency * t + phase)".into(),
            source: "standard: linear response".into(),
        }
    }

    fn proposals(&self, _: &Site<'_>) -> Vec<Table> {
        vec![Table::new()]
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let time = place.time.ok_or("the model has no time")?;
        let (frequency, phase) =
            (format!("{}_frequency", place.name), format!("{}_phase", place.name));
        let unit = time.unit.power(-1.0).ok_or("the time has no unit that can be inverted")?;
        let (low, high) = (0.75 / time.duration, (12.0 / time.duration).min(0.5 / time.step));
        let given = self.frequency.clone();
        let prior = given.unwrap_or(Distribution::Uniform([low, high.max(2.0 * low)]));
        let (from, to) = (prior.quantile(0.01), prior.quantile(0.99));
        // Neighbouring frequencies differ by half an oscillation over the whole response, unless that makes the list
        // too long.
        let count = ((2.0 * (to - from) * time.duration).ceil() as usize + 1).clamp(2, MOST);
        let step = (to - from) / (count - 1) as f64;
        let starts = (0..count).map(|i| from + step * i as f64).collect();
        let turn = Distribution::Uniform([-PI, PI]);
        let quarter = vec![0.0, 0.5 * PI];
        Ok(Summand {
            shape: format!("cos(2 * pi * {frequency} * {} + {phase})", time.name),
            sign: Sign::Either,
            indices: vec![
                Index { name: frequency, unit, prior, starts },
                Index { name: phase, unit: Unit::dimensionless(), prior: turn, starts: quarter },
            ],
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "forcing", Forcing);
