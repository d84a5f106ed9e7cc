//! What may be missing: effects with their options, in the places where they may act.

use std::sync::Arc;

use toml::Table;

use super::experiment::{Curve, Experiment};
use crate::plugin::Effect;
use crate::plugin::effect::{On, Placed, Reach, Situation};
use crate::plugin::registry;

/// An effect that may be missing.
#[derive(Clone)]
pub struct Candidate {
    /// What it is called: the name of its plugin, where the study gives no other.
    pub kind: String,
    /// The name of its plugin.
    pub plugin: String,
    /// Its options, as a study would say them.
    pub options: Table,
    /// The effect.
    pub effect: Arc<dyn Effect>,
}

/// A candidate in a place.
#[derive(Clone)]
pub struct Suspect {
    /// Its place among the candidates.
    pub candidate: usize,
    /// Where it acts.
    pub on: On,
}

impl Candidate {
    /// An effect of this plugin with these options, known as `kind`.
    pub fn of(kind: &str, plugin: &str, options: &Table) -> Result<Self, String> {
        let built = registry::from_text::<dyn Effect>(plugin, &options.to_string())
            .map_err(|error| format!("the options of `{plugin}`: {error}"))?;
        let effect = Arc::from(built.plugin);
        Ok(Self {
            kind: kind.to_owned(),
            plugin: plugin.to_owned(),
            options: options.clone(),
            effect,
        })
    }
}

/// The proposals of all installed effects, or of those named, on such data.
pub fn proposed(
    names: Option<&[String]>,
    situation: &Situation<'_>,
) -> Result<Vec<Candidate>, String> {
    let mut all = Vec::new();
    for entry in registry::entries::<dyn Effect>() {
        if names.is_some_and(|names| !names.iter().any(|name| name == entry.name)) {
            continue;
        }
        let build = |options: &Table| {
            registry::from_text::<dyn Effect>(entry.name, &options.to_string())
                .map_err(|error| format!("the proposal of `{}`: {error}", entry.name))
        };
        for options in build(&Table::new())?.plugin.proposals(situation) {
            all.push(Candidate::of(entry.name, entry.name, &options)?);
        }
    }
    Ok(all)
}

/// The candidates in the places where a first search looks: on everything, and on each sensor.
pub fn suspects(experiment: &Experiment<'_>, candidates: &[Candidate]) -> Vec<Suspect> {
    let sensors = sensors(experiment);
    let mut all = Vec::new();
    for (candidate, known) in candidates.iter().enumerate() {
        let reach = known.effect.reach();
        if reach != Reach::Single || sensors.len() < 2 {
            all.push(Suspect { candidate, on: On::new() });
        }
        if reach != Reach::Whole && sensors.len() >= 2 {
            all.extend(sensors.iter().map(|on| Suspect { candidate, on: on.clone() }));
        }
    }
    all
}

/// The label combinations of the curves, scenarios aside.
pub fn sensors(experiment: &Experiment<'_>) -> Vec<On> {
    let mut all: Vec<On> = Vec::new();
    for curve in &experiment.curves {
        let on = place(curve);
        if !on.is_empty() && !curve.measured.is_empty() && !all.contains(&on) {
            all.push(on);
        }
    }
    all
}

/// The labels of a curve as a place.
pub fn place(curve: &Curve) -> On {
    curve.labels.iter().map(|(axis, label)| (axis.clone(), vec![label.clone()])).collect()
}

impl Suspect {
    /// The effect in its place.
    pub fn placed<'a>(
        &self,
        experiment: &Experiment<'a>,
        candidates: &'a [Candidate],
        name: &str,
    ) -> Placed<'a> {
        let effect = &*candidates[self.candidate].effect;
        Placed::new(name, effect, experiment.layouts, &self.on)
    }
}
