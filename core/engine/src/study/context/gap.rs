//! Consistency of `[gap]` with the rest of the study: the candidates and the held-out data must exist.

use lacuna::data::{Axis, Coordinates};
use lacuna::plugin::{Effect, Term, registry};
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::values::Interval;
use lacuna::text::{Complaints, Node, Problems};

use crate::study::resolve::Study;

/// Reports effects that are not installed, and places that the response does not have.
pub(super) fn check(study: &Study, root: &Node, problems: &mut Problems) {
    let Some(node) = root.get("gap") else { return };
    problems.within("gap", |problems| {
        let mut complaints = Complaints::new(node, problems);
        candidates(study, &mut complaints);
        scenarios(study, &mut complaints);
        super::effects::places(study, "hold_out.on", &study.gap.keys.hold_out.on, &mut complaints);
        along(study, &mut complaints);
        if study.measurements.is_none() {
            complaints
                .at("")
                .say("the study has no `[measurements]` to search for a gap")
                .help("add `[measurements]`, or take `[gap]` out");
        }
        super::inside::check(study, node, problems);
        super::inside::no_places(study, node, problems);
        super::runs::check(study, node, problems);
        super::next::check(study, node, problems);
        if let (Some(companion), Some(node)) = (&study.gap.companion, node.get("companion")) {
            problems.within("companion", |problems| {
                super::companion::check(study, companion, node, problems);
            });
        }
    });
}

fn candidates(study: &Study, complaints: &mut Complaints<'_>) {
    let effects: Vec<&str> = registry::entries::<dyn Effect>().iter().map(|e| e.name).collect();
    let terms: Vec<&str> = registry::entries::<dyn Term>().iter().map(|e| e.name).collect();
    let has_equations = study.model.as_ref().is_some_and(|m| m.built.plugin.amend().is_some());
    for candidate in study.gap.keys.candidates.iter().flatten() {
        let name = candidate.as_str();
        if effects.contains(&name) {
            continue;
        }
        if terms.contains(&name) {
            if study.surrogate.is_some() || !has_equations {
                complaints
                    .at("candidates")
                    .say(format!("the study has no place for the term `{name}`"))
                    .expected("a model that the study writes as equations, and no `[surrogate]`")
                    .help("with a surrogate, name the term and its state in `[[gap.term]]`");
            } else if needs_options(name) {
                complaints
                    .at("candidates")
                    .say(format!("the term `{name}` needs numbers that only the study knows"))
                    .help("name it with its state and its options in `[[gap.term]]`");
            }
            continue;
        }
        let names: Vec<&str> = effects.iter().chain(&terms).copied().collect();
        let problem = complaints
            .at("candidates")
            .say(format!("no effect and no term is called `{candidate}`"));
        problem.expected(one_of(names.iter().copied()));
        if let Some(near) = nearest(candidate, names.iter().copied()) {
            problem.help(format!("did you mean `{near}`?"));
        }
    }
}

/// Returns true if a term proposes nothing without options.
fn needs_options(term: &str) -> bool {
    registry::from_text::<dyn Term>(term, "").is_err()
}

fn scenarios(study: &Study, complaints: &mut Complaints<'_>) {
    let held = &study.gap.keys.hold_out.scenarios;
    known_scenarios(study, "hold_out.scenarios", held, complaints);
    let names: Vec<&str> = study.scenarios.iter().filter_map(|s| s.label()).collect();
    if !held.is_empty() && names.iter().all(|name| held.iter().any(|held| held == name)) {
        complaints
            .at("hold_out.scenarios")
            .say("all scenarios are held out")
            .expected("at least one that is calibrated with");
    }
}

/// Reports scenarios, written under the key `path`, that the study does not have.
pub(super) fn known_scenarios(
    study: &Study,
    path: &str,
    wanted: &[String],
    complaints: &mut Complaints<'_>,
) {
    let names: Vec<&str> = study.scenarios.iter().filter_map(|s| s.label()).collect();
    for name in wanted.iter().filter(|name| !names.contains(&name.as_str())) {
        let spot = complaints.at(path);
        let problem = spot.say(format!("the study has no scenario `{name}`"));
        if names.is_empty() {
            problem
                .help("a study without `[[scenario]]` can choose replicates, curves and intervals");
        } else {
            problem.expected(one_of(names.iter().copied()));
        }
    }
}

fn along(study: &Study, complaints: &mut Complaints<'_>) {
    known_intervals(study, "hold_out.along", &study.gap.keys.hold_out.along, complaints);
}

/// Reports intervals of the last axis, written under the key `path`, in which the response has no value.
pub(super) fn known_intervals(
    study: &Study,
    path: &str,
    wanted: &[Interval],
    complaints: &mut Complaints<'_>,
) {
    let of_axis = |axis: &Axis| match &axis.coordinates {
        Coordinates::Grid { values, .. } => Some((values[0], values[values.len() - 1])),
        Coordinates::Labels(_) => None,
    };
    let blocks = study.layouts.blocks.iter();
    let spans: Vec<(f64, f64)> =
        blocks.filter_map(|block| block.axes.last().and_then(of_axis)).collect();
    for interval in wanted {
        let (low, high) = (interval.low(), interval.high());
        if spans.iter().any(|(first, last)| low <= *last && high >= *first) {
            continue;
        }
        let spot = complaints.at(path);
        let problem = spot.say(format!("no value of the response lies from {low} to {high}"));
        match spans.first() {
            Some((first, last)) => {
                problem.expected(format!("intervals of the last axis, from {first} to {last}"));
            }
            None => {
                problem.help("the response has no axis of numbers: take `along` out");
            }
        }
    }
}
