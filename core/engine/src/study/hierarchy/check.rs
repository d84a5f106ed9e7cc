//! Combinations with parameters by group that a study cannot have.

use lacuna::math::distribution::Distribution;
use lacuna::plugin::Effect;
use lacuna::plugin::registry::Section;
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::{Complaints, Node, Problems};

use crate::study::file::{EffectKeys, ParameterSection, ScatterKeys};
use crate::study::plain::Study;

/// Reports keys of a parameter that contradict each other.
pub(in crate::study) fn keys(
    section: &ParameterSection,
    emulated: bool,
    complaints: &mut Complaints<'_>,
) {
    let path = format!("parameter.{}", section.name);
    if section.by.is_none() {
        for (key, there) in [
            ("population", section.population.is_some()),
            ("coordinates", !section.coordinates.is_auto()),
        ] {
            if there {
                complaints
                    .at(&format!("{path}.{key}"))
                    .say(format!("`{key}` is about groups, and the parameter has none"))
                    .help("add `by`: the label of the scenarios that makes the groups, or \"scenario\"");
            }
        }
        return;
    }
    if section.scenario.is_some() {
        complaints
            .at(&format!("{path}.scenario"))
            .say("a parameter by group belongs to no single scenario")
            .help("take `scenario` out; `by = \"scenario\"` makes each scenario a group");
    }
    let Some(population) = &section.population else {
        if !section.coordinates.is_auto() {
            complaints
                .at(&format!("{path}.coordinates"))
                .say("`coordinates` is about a population, and the parameter has none")
                .help("add `population`, or take `coordinates` out");
        }
        return;
    };
    if section.prior.is_some() {
        complaints
            .at(&format!("{path}.prior"))
            .say("the values of the groups have their prior from the population")
            .help(
                "take `prior` out, or `population` for groups that are independent of each other",
            );
    }
    if emulated && section.design.is_none() {
        complaints
            .at(&path)
            .say("missing key `design`")
            .expected("the range in which the runs vary the parameter, such as `design = { uniform = [0, 1] }`");
    }
    let under = format!("{path}.population.{}", population.name());
    let [(place, location), (spread, scale)] = population.unknowns();
    positive(&format!("{under}.{spread}"), scale, complaints);
    if population.name() == "log_normal" && location.support().0 < 0.0 {
        complaints
            .at(&format!("{under}.{place}"))
            .say("the median of a log-normal population is above zero")
            .expected("a prior of positive numbers, such as `{ log_uniform = [1, 10] }`")
            .found(location);
    }
}

/// Reports a prior of a scatter that allows negative numbers.
fn positive(path: &str, scale: &Distribution, complaints: &mut Complaints<'_>) {
    if scale.support().0 < 0.0 {
        complaints
            .at(path)
            .say("the scatter between groups is not below zero")
            .expected("a prior of positive numbers, such as `{ half_normal = 1 }`")
            .found(scale);
    }
}

/// Reports the prior of a scatter, written under the key `path`, that allows negative numbers.
fn scatter(path: &str, keys: &ScatterKeys, complaints: &mut Complaints<'_>) {
    let (spread, scale) = keys.scale();
    positive(&format!("{path}.{}.{spread}", keys.name()), scale, complaints);
}

/// Reports populations of the discrepancy's unknowns that cannot be. Its unknowns are known only with the data, but most are
/// options that were given a prior: a name that is almost one of these is a mistake.
fn of_discrepancy(study: &Study, complaints: &mut Complaints<'_>) {
    let Some(section) = &study.discrepancy else { return };
    let options = &section.built.options;
    for (name, keys) in &section.common.population {
        let path = format!("discrepancy.population.{name}");
        let near = nearest(name, options.keys().map(String::as_str));
        if let (false, Some(near)) = (options.contains_key(name), near) {
            complaints
                .at(&path)
                .say(format!("the discrepancy has no unknown `{name}`"))
                .help(format!("did you mean `{near}`?"));
        }
        scatter(&path, keys, complaints);
    }
}

/// Reports populations of an effect's unknowns that it does not have, and those without groups.
pub(in crate::study) fn of_effect(
    study: &Study,
    section: &Section<dyn Effect, EffectKeys>,
    complaints: &mut Complaints<'_>,
) {
    let EffectKeys { by, population, .. } = &section.common;
    let unknowns = section.built.plugin.parameters(&study.layouts.blocks[0]);
    let known: Vec<&str> = unknowns.iter().map(|own| own.name.as_str()).collect();
    for (name, keys) in population {
        let path = format!("population.{name}");
        if by.is_none() {
            complaints
                .at(&path)
                .say("a population has groups as members, and the effect has none")
                .help(
                    "add `by`: the label of the scenarios that makes the groups, or \"scenario\"",
                );
        }
        if !known.contains(&name.as_str()) {
            let problem = complaints.at(&path).say(format!("the effect has no unknown `{name}`"));
            problem.expected(one_of(known.iter().copied()));
            if let Some(near) = nearest(name, known.iter().copied()) {
                problem.help(format!("did you mean `{near}`?"));
            }
        }
        scatter(&path, keys, complaints);
    }
}

/// Reports sections that do not know parameters by group yet.
pub(in crate::study) fn check(study: &Study, complaints: &mut Complaints<'_>) {
    of_discrepancy(study, complaints);
    if study.hierarchy.trained.is_some() {
        let refine = study.surrogate.as_ref().is_some_and(|s| s.common.refine.is_some());
        let refused =
            [("surrogate.refine", refine), ("low_fidelity", study.low_fidelity.is_some())];
        for (key, _) in refused.iter().filter(|(_, there)| *there) {
            complaints
                .at(key)
                .say(format!("`{key}` does not work with parameters by group"))
                .help("take it out, or share the parameters between the groups");
        }
        if study.design.as_ref().is_some_and(|section| section.built.plugin.is_sequential()) {
            complaints
                .at("design.use")
                .say("a design that follows the data does not work with parameters by group")
                .expected("a design whose points do not depend on the runs");
        }
        for unknown in study.unknowns.iter().filter(|unknown| unknown.scenario.is_some()) {
            complaints
                .at(&format!("parameter.{}.scenario", unknown.name))
                .say("an emulator has parameters by group or by scenario, not both")
                .expected("`by = \"scenario\"` in place of `scenario`, or no `by` elsewhere");
        }
    }
    for section in &study.dependence_sections.dependence {
        let of_population = |name: &&String| {
            let place = study.parameters.iter().position(|p| p.name == **name);
            place.is_some_and(|j| study.dependence.population_of(j).is_some())
        };
        for name in section.parameters.iter().filter(of_population) {
            complaints
                .at("dependence")
                .say(format!("`{name}` has its prior from its population"))
                .expected("parameters without `population`");
        }
    }
}

/// Reports the parameters whose keys contradict each other.
pub(in crate::study) fn of_sections(
    sections: &[ParameterSection],
    emulated: bool,
    root: &Node,
    problems: &mut Problems,
) {
    let mut complaints = Complaints::new(root, problems);
    for section in sections {
        keys(section, emulated, &mut complaints);
    }
}
