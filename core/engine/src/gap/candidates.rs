//! Candidates: the effects that may be missing, with their options, and the placements in which they may act.

use std::sync::Arc;

use lacuna::plugin::effect::{On, Placed, Reach, Situation};
use lacuna::plugin::{Effect, registry};
use toml::Table;

use super::experiment::{Experiment, MeasuredCurve};

/// An effect that may be missing.
#[derive(Clone)]
pub struct Candidate {
    /// The type: the name that the study gives the candidate, otherwise that of the plugin.
    pub kind: String,
    /// The name of the plugin.
    pub plugin: String,
    /// The options, as written in a study.
    pub options: Table,
    /// The effect.
    pub effect: Arc<dyn Effect>,
}

/// A candidate with the labels on which it acts.
#[derive(Clone)]
pub struct Placement {
    /// The index of the candidate.
    pub candidate: usize,
    /// The labels on which it acts, by axis; empty for all.
    pub on: On,
}

impl Candidate {
    /// The candidate of type `kind`: an effect of this plugin with these options. Fails if the options are invalid.
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

/// The candidates that all installed effects, or those named, propose for such data.
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

/// The placements that are scored: each candidate on all sensors, and on each single sensor, as far as its reach
/// allows.
pub fn placements(experiment: &Experiment<'_>, candidates: &[Candidate]) -> Vec<Placement> {
    let sensors = sensors(experiment);
    let mut all = Vec::new();
    for (candidate, known) in candidates.iter().enumerate() {
        let reach = known.effect.reach();
        if reach != Reach::Single || sensors.len() < 2 {
            all.push(Placement { candidate, on: On::new() });
        }
        if reach != Reach::Whole && sensors.len() >= 2 {
            all.extend(sensors.iter().map(|on| Placement { candidate, on: on.clone() }));
        }
    }
    all
}

/// The sensors: the label combinations of the measured curves, without the scenario.
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

/// The sensor of a curve: its labels by axis.
pub fn place(curve: &MeasuredCurve) -> On {
    curve.labels.iter().map(|(axis, label)| (axis.clone(), vec![label.clone()])).collect()
}

impl Placement {
    /// The effect on the labels of the placement, called `name`.
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
