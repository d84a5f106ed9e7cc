//! Statistics of each trajectory, under the names of ArviZ.

use lacuna::data::Statistic;
use lacuna::data::statistics::Kind;
use lacuna::plugin::sampler::State;
use serde::{Deserialize, Serialize};

use super::chains::Transition;

/// Statistics of one trajectory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Last {
    acceptance: f64,
    divergent: bool,
    energy: f64,
    gradients: u64,
    saturated: bool,
    step: f64,
    depth: Option<u32>,
}

impl Last {
    pub fn of(done: &Transition, step: f64) -> Self {
        let &Transition { acceptance, gradients, divergent, saturated, energy, depth, .. } = done;
        Self { acceptance, divergent, energy, gradients, saturated, step, depth }
    }
}

/// A statistic: its name, its kind, and the function that reads it.
type Told = (&'static str, Kind, fn(&Last) -> f64);

/// Returns the statistics of the last trajectory of each chain; `doubles` adds those of trees.
pub(crate) fn statistics(state: &State, doubles: bool) -> Vec<Statistic> {
    const ALL: [Told; 7] = [
        ("acceptance_rate", Kind::Number, |last| last.acceptance),
        ("diverging", Kind::Flag, |last| f64::from(u8::from(last.divergent))),
        ("energy", Kind::Number, |last| last.energy),
        ("n_steps", Kind::Count, |last| last.gradients as f64),
        ("step_size", Kind::Number, |last| last.step),
        ("tree_depth", Kind::Count, |last| f64::from(last.depth.unwrap_or(0))),
        ("reached_max_treedepth", Kind::Flag, |last| f64::from(u8::from(last.saturated))),
    ];
    let chains = state.memory.get("chains").and_then(serde_json::Value::as_array);
    let last: Vec<Option<Last>> = chains
        .into_iter()
        .flatten()
        .map(|chain| chain.get("last").and_then(|last| Last::deserialize(last).ok()))
        .collect();
    let one = |&(name, kind, value): &Told| Statistic {
        name: name.to_owned(),
        kind,
        values: last.iter().map(|last| last.as_ref().map_or(f64::NAN, value)).collect(),
    };
    ALL[..if doubles { 7 } else { 5 }].iter().map(one).collect()
}
