//! Combinations with parameters by group that a study cannot have.

use lacuna::text::{Complaints, Node, Problems};

use crate::study::file::ParameterSection;
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
    let [(place, location), (spread, scale)] = population.unknowns();
    let under = format!("{path}.population.{}", population.name());
    if scale.support().0 < 0.0 {
        complaints
            .at(&format!("{under}.{spread}"))
            .say("the scatter between groups is not below zero")
            .expected("a prior of positive numbers, such as `{ half_normal = 1 }`")
            .found(scale);
    }
    if population.name() == "log_normal" && location.support().0 < 0.0 {
        complaints
            .at(&format!("{under}.{place}"))
            .say("the median of a log-normal population is above zero")
            .expected("a prior of positive numbers, such as `{ log_uniform = [1, 10] }`")
            .found(location);
    }
}

/// Reports sections that do not know parameters by group yet.
pub(in crate::study) fn check(study: &Study, complaints: &mut Complaints<'_>) {
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
