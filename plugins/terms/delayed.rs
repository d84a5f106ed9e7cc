//! `delayed`: a delayed reaction.

use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::State;
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Place, Site, Summand};
use lacuna::plugin::{Component, Term};
use lacuna::text::values::Count;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::common::of;

/// A delayed reaction: the rate depends on the state some time before.
///
/// ```text
/// rate = … + coefficient (u(t - delay) - u(t))
/// ```
///
/// The delay is approximated by a chain of first-order lags (the linear chain trick; Smith, An Introduction to Delay
/// Differential Equations, 2011, chapter 7): more lags make it sharper. Each lag is a state of its own with the
/// initial value of `u`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Delayed {
    /// Delayed quantity `u`, as an expression. Default: the state itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Initial value of `u`, as an expression of the model's inputs. Required with `of`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<String>,
    /// Number of lags. More lags make the delay sharper and add as many states.
    #[serde(default = "lags")]
    pub lags: Count,
    /// Prior of the delay, in the unit of the time. Default: log-uniform from one step to a quarter of the duration
    /// of the response.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay: Option<Distribution>,
}

fn lags() -> Count {
    Count::new(3).unwrap_or_else(|_| unreachable!("3 is a count"))
}

impl Component for Delayed {}

impl Term for Delayed {
    fn describe(&self) -> Description {
        Description {
            title: "a delayed reaction".into(),
            formula: "coefficient * (u(t - delay) - u(t))".into(),
            source: "Smith, An Introduction to Delay Differential Equations (2011), chapter 7"
                .into(),
        }
    }

    fn proposals(&self, _: &Site<'_>) -> Vec<Table> {
        vec![Table::new()]
    }

    fn summand(&self, place: &Place<'_>) -> Result<Summand, String> {
        let u = of(self.of.as_deref(), place);
        let time = place.time.ok_or("the model has no time")?;
        if self.of.is_some() && self.start.is_none() {
            return Err("where it begins is not known: give `start`".into());
        }
        let start = self.start.as_ref().unwrap_or(&place.state.start);
        let delay = format!("{}_delay", place.name);
        let (count, name) = (self.lags.get(), |i: usize| format!("{}_lag{i}", place.name));
        let lag = |i: usize| {
            let before = if i == 1 { format!("({u})") } else { name(i - 1) };
            State {
                name: name(i),
                unit: place.state.unit.clone(),
                rate: format!("{count} * ({before} - {}) / {delay}", name(i)),
                start: start.clone(),
                ..State::default()
            }
        };
        let longest = (0.25 * time.duration).max(2.0 * time.step);
        let prior = self.delay.clone();
        let prior = prior.unwrap_or(Distribution::LogUniform([time.step, longest]));
        let starts = [0.1, 0.35, 0.6, 0.85].map(|p| prior.quantile(p)).to_vec();
        Ok(Summand {
            shape: format!("{} - ({u})", name(count)),
            indices: vec![Index { name: delay.clone(), unit: time.unit.clone(), prior, starts }],
            states: (1..=count).map(lag).collect(),
            scale: Some(u.to_owned()),
            ..Summand::default()
        })
    }
}

lacuna::register!(Term, "delayed", Delayed);
