//! The options of a study: those that it lists, or further replicates of everything, of each condition and by each sensor.

use lacuna::plugin::effect::On;
use lacuna::text::values::{Count, Fraction, Positive};

use super::Wish;
use super::choice::{Choice, Taken};
use super::planned::{chosen, planned};
use crate::gap::candidates::{on_words, place};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;
use crate::study::gap::next::NextKeys;

/// Numbers of further replicates that are tried unless the study lists options.
const REPLICATES: [usize; 2] = [1, 4];

/// The options of an experiment with this noise, and the names of those that measure nothing.
pub(super) fn options<'a>(
    experiment: &Experiment<'a>,
    noise: &Noise,
    wish: Wish<'_>,
) -> (Vec<Choice<'a>>, Vec<String>) {
    let usual = if wish.options.is_empty() { usual(experiment) } else { Vec::new() };
    let (mut some, mut without_data) = (Vec::new(), Vec::new());
    for keys in wish.options.iter().chain(&usual) {
        match choice(keys, experiment, noise, wish.runs) {
            Some(choice) => some.push(choice),
            None => without_data.push(named(keys)),
        }
    }
    (some, without_data)
}

/// The name of an option: as the study states it, or what is taken, in words.
fn named(keys: &NextKeys) -> String {
    let in_words = || if keys.is_computed() { computed(keys) } else { measured(keys) };
    keys.name.as_ref().map_or_else(in_words, |name| name.as_str().to_owned())
}

/// One and four replicates of all that was measured, of each condition, and by each sensor.
fn usual(experiment: &Experiment<'_>) -> Vec<NextKeys> {
    let mut places = vec![NextKeys::default()];
    if experiment.conditions.len() > 1 {
        let names = experiment.conditions.iter().filter_map(|own| own.scenario.clone());
        places.extend(names.map(|name| NextKeys { scenarios: vec![name], ..NextKeys::default() }));
    }
    let mut sensors: Vec<On> = Vec::new();
    for on in experiment.curves.iter().map(place).filter(|on| !on.is_empty()) {
        if !sensors.contains(&on) {
            sensors.push(on);
        }
    }
    if sensors.len() > 1 {
        places.extend(sensors.into_iter().map(|on| NextKeys { on, ..NextKeys::default() }));
    }
    let counts = REPLICATES.map(|n| Count::new(n).ok());
    let each = |keys: NextKeys| {
        counts.into_iter().flatten().map(move |replicates| NextKeys { replicates, ..keys.clone() })
    };
    places.into_iter().flat_map(each).collect()
}

/// An option as the study states it; `None` if it measures nothing.
fn choice<'a>(
    keys: &NextKeys,
    experiment: &Experiment<'a>,
    noise: &Noise,
    runs: usize,
) -> Option<Choice<'a>> {
    let name = named(keys);
    if keys.is_computed() {
        let emulator = keys.emulator_error.map(Fraction::get);
        let more = keys.runs.map(|more| (runs as f64 / (runs + more.get()) as f64).sqrt());
        let taken = Taken::Errors {
            emulator: emulator.or(more).unwrap_or(1.0),
            numerics: keys.numerical_error.map_or(1.0, Fraction::get),
            origins: experiment.origins.clone(),
        };
        let cost = keys.cost.map_or(1.0, Positive::get);
        return Some(Choice { name, cost, taken });
    }
    let outputs = chosen(experiment, keys);
    let (own, noise) = planned(experiment, noise, &outputs, keys.noise.map(Positive::get));
    let scenarios = own.conditions.iter().filter(|c| !c.curves.is_empty()).count();
    let count = keys.replicates.get();
    let usual = (scenarios * count) as f64;
    let taken = Taken::Replicates { count, planned: Box::new((own, noise)) };
    let cost = keys.cost.map_or(usual, Positive::get);
    let choice = Choice { name, cost, taken };
    (scenarios > 0).then_some(choice)
}

/// The measurements of an option in words.
fn measured(keys: &NextKeys) -> String {
    let mut words = match keys.replicates.get() {
        1 => "1 replicate".to_owned(),
        n => format!("{n} replicates"),
    };
    if keys.scenarios.is_empty() && keys.on.is_empty() && keys.along.is_empty() {
        words += " of everything";
    }
    if !keys.scenarios.is_empty() {
        let names: Vec<String> = keys.scenarios.iter().map(|name| format!("`{name}`")).collect();
        words += &format!(" under {}", names.join(", "));
    }
    if !keys.on.is_empty() {
        words += &on_words(&keys.on);
    }
    for interval in &keys.along {
        words += &format!(" from {} to {}", interval.low(), interval.high());
    }
    words
}

/// The computations of an option in words.
fn computed(keys: &NextKeys) -> String {
    let runs = keys.runs.map(|runs| format!("{} runs of the simulator", runs.get()));
    let emulator = keys.emulator_error.filter(|_| keys.runs.is_none());
    let emulator = emulator.map(|factor| format!("error of the surrogate times {}", factor.get()));
    let numerics = keys.numerical_error;
    let numerics = numerics.map(|factor| format!("error of the mesh times {}", factor.get()));
    let all: Vec<String> = runs.into_iter().chain(emulator).chain(numerics).collect();
    all.join(", ")
}
