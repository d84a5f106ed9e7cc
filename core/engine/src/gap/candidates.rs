//! Candidates: the effects that may be missing, with their options, and the placements in which they may act.

use std::collections::BTreeMap;
use std::sync::Arc;

use lacuna::data::Unit;
use lacuna::plugin::effect::{On, Placed, Reach, Situation};
use lacuna::plugin::{Effect, registry};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::experiment::{Experiment, MeasuredCurve};
use crate::study::positions::Positions;

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
    /// The prior odds of its group, which are those of all physics inside the model or of all effects on the response.
    pub odds: f64,
    /// Types that it contains as special cases.
    pub contains: Vec<&'static str>,
    /// The number of forms among which it was chosen by the data; 1 for a candidate that was stated beforehand.
    pub tried: usize,
    /// Values of the calibrated parameters beside it, from which fits with it start as well; empty for none.
    pub beside: Vec<f64>,
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
            odds: 1.0,
            contains: Vec::new(),
            tried: 1,
            beside: Vec::new(),
        })
    }

    /// Returns true if it acts inside the model.
    pub fn is_inside(&self) -> bool {
        !self.effect.switches().is_empty() || self.effect.acts_first()
    }
}

/// The log prior mass of a type of the group of `candidate`, times the number of types: the groups share the prior mass
/// by their odds, and the types of a group share that of the group.
pub fn log_group_share(candidates: &[Candidate], candidate: &Candidate) -> f64 {
    let mut seen: Vec<&Candidate> = Vec::new();
    for other in candidates {
        if !seen.iter().any(|known| known.kind == other.kind) {
            seen.push(other);
        }
    }
    let own = seen.iter().filter(|other| other.is_inside() == candidate.is_inside());
    let others = seen.iter().find(|other| other.is_inside() != candidate.is_inside());
    let Some(others) = others else { return 0.0 };
    let share = candidate.odds / (candidate.odds + others.odds);
    (share * seen.len() as f64 / own.count() as f64).ln()
}

/// The effects that propose themselves for some data, and those that do not.
#[derive(Default)]
pub struct Proposed {
    /// The candidates.
    pub candidates: Vec<Candidate>,
    /// The effects that are not tried.
    pub untried: Vec<Untried>,
}

/// An effect that is not tried.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Untried {
    /// Name of the effect.
    #[serde(rename = "type")]
    #[schemars(rename = "type")]
    pub kind: String,
    /// Reason, in words.
    pub reason: String,
}

/// The options of an effect along an axis with positions.
fn options_along(line: &Positions) -> Table {
    let at = line.at.iter().map(|(label, x)| (label.clone(), Value::Float(*x)));
    let text = |text: &str| Value::String(text.to_owned());
    Table::from_iter([
        ("axis".to_owned(), text(&line.axis)),
        ("positions".to_owned(), Value::Table(at.collect())),
        ("unit".to_owned(), text(&line.unit.to_string())),
    ])
}

/// The candidates that all installed effects, or those named, propose for such data; `positions` are those of the labels
/// that the study states.
pub fn proposed(
    names: Option<&[String]>,
    positions: &[Positions],
    situation: &Situation<'_>,
) -> Result<Proposed, String> {
    let mut all = Proposed::default();
    for entry in registry::entries::<dyn Effect>() {
        if names.is_some_and(|names| !names.iter().any(|name| name == entry.name)) {
            continue;
        }
        let build = |options: &Table| {
            registry::from_text::<dyn Effect>(entry.name, &options.to_string())
                .map_err(|error| format!("the proposal of `{}`: {error}", entry.name))
        };
        let mut proposals = build(&Table::new())?.plugin.proposals(situation);
        // Effects along a line of sensors take their positions; others have no such option.
        for along in positions.iter().filter_map(|axis| build(&options_along(axis)).ok()) {
            let further = along.plugin.proposals(situation);
            proposals.extend(further.into_iter().filter(|own| own.contains_key("positions")));
        }
        if proposals.is_empty() {
            let nowhere =
                Positions { axis: String::new(), at: BTreeMap::new(), unit: Unit::default() };
            let needs_positions = positions.is_empty() && build(&options_along(&nowhere)).is_ok();
            let reason = if needs_positions {
                "needs the `positions` of the sensors on their axis in `[response]`"
            } else {
                "has nothing to act on in these data"
            };
            let (kind, reason) = (entry.name.to_owned(), reason.to_owned());
            all.untried.push(Untried { kind, reason });
        }
        for options in proposals {
            all.candidates.push(Candidate::of(entry.name, entry.name, &options)?);
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

/// Labels on which an effect acts, as ` on sensor R, V`; empty if it acts everywhere.
pub fn on_words(on: &On) -> String {
    let each: Vec<String> =
        on.iter().map(|(axis, labels)| format!("{axis} {}", labels.join(", "))).collect();
    if each.is_empty() { String::new() } else { format!(" on {}", each.join(" and ")) }
}

impl Placement {
    /// True for the same candidate in the same place.
    pub fn is(&self, other: &Self) -> bool {
        self.candidate == other.candidate && self.on == other.on
    }

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::experiment::wider::FreeInput;
    use crate::gap::system::switched::InputEffect;
    use lacuna::math::distribution::Distribution;
    use lacuna::plugin::effect::Description;

    fn candidate(kind: &str, places: Vec<usize>, odds: f64) -> Candidate {
        let prior = Distribution::Normal([0.0, 1.0]);
        let description =
            Description { title: String::new(), formula: String::new(), source: String::new() };
        let inputs = vec![FreeInput::new(kind, Unit::default(), 0.0, prior)];
        Candidate {
            kind: kind.to_owned(),
            plugin: kind.to_owned(),
            options: Table::new(),
            effect: Arc::new(InputEffect { places, inputs, description }),
            odds,
            contains: Vec::new(),
            tried: 1,
            beside: Vec::new(),
        }
    }

    /// The shares of all types add up to one, those of the groups are in the ratio of their odds, and a group alone has
    /// everything.
    #[test]
    fn groups_share_by_their_odds() {
        let response = ["gain", "gain", "delay", "offset"].map(|kind| candidate(kind, vec![], 1.0));
        let inside = ["drag", "spring"].map(|kind| candidate(kind, vec![0], 4.0));
        let all = [&response[..], &inside[..]].concat();
        let mass = |one: &Candidate| log_group_share(&all, one).exp() / 5.0;
        let of_response = 3.0 * mass(&response[0]);
        let of_inside = 2.0 * mass(&inside[0]);
        assert!((of_response + of_inside - 1.0).abs() < 1e-12, "{of_response} {of_inside}");
        assert!((of_inside / of_response - 4.0).abs() < 1e-12);
        assert!(log_group_share(&inside, &inside[0]).abs() < 1e-12);
    }
}
