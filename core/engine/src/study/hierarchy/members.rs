//! The parameters that a parameter with `by` stands for: a member for each group, and the unknowns of their population.

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Form, Parameter, Population, Scenario, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::text::nearest::{nearest, one_of};
use lacuna::text::{Complaints, Node, Problems};

use super::{Member, PopulationKeys};
use crate::study::file::{ParameterSection, Prior};
use crate::study::unknowns::{Unknown, UnknownKind};

/// Adds the parameters of a section with `by`; `prior` is that of members without a population.
pub(in crate::study) fn members(
    section: &ParameterSection,
    prior: Option<&Distribution>,
    scenarios: &[Scenario],
    (parameters, unknowns): (&mut Vec<Parameter>, &mut Vec<Unknown>),
    root: &Node,
    problems: &mut Problems,
) -> Option<Population> {
    let path = format!("parameter.{}", section.name);
    let groups = groups(section, scenarios, &path, root, problems)?;
    let marginal = section.population.as_ref().map(PopulationKeys::marginal);
    let own = marginal.as_ref().or(prior)?;
    let design = section.design.as_ref().unwrap_or(own);
    let name = section.name.as_str();
    let symbol = section.symbol.as_deref().unwrap_or(name);
    let first = parameters.len();
    let names = groups.iter().map(|own| format!("{}={}", own.by, own.group)).collect();
    for member in groups {
        parameters.push(Parameter {
            name: format!("{name}[{}]", member.group),
            symbol: format!("{symbol}[{}]", member.group),
            unit: section.unit.clone(),
            design: design.clone(),
            prior: own.clone(),
            reference: section.reference,
        });
        unknowns.push(Unknown {
            name: name.to_owned(),
            scenario: None,
            member: Some(member),
            kind: UnknownKind::Parameter,
            interval: matches!(section.prior, Some(Prior::Interval { .. })),
            cut: section.cut,
        });
    }
    let population = section.population.as_ref()?;
    let members: Vec<usize> = (first..parameters.len()).collect();
    let places = [parameters.len(), parameters.len() + 1];
    let form = population.form();
    for (k, (key, prior)) in population.unknowns().into_iter().enumerate() {
        let relative = k == 1 && form == Form::LogNormal;
        parameters.push(Parameter {
            name: format!("{name}.{key}"),
            symbol: format!("{symbol}.{key}"),
            unit: if relative { Unit::dimensionless() } else { section.unit.clone() },
            design: prior.clone(),
            prior: prior.clone(),
            reference: section.reference.filter(|_| k == 0),
        });
        unknowns.push(Unknown {
            name: format!("{name}.{key}"),
            scenario: None,
            member: None,
            kind: UnknownKind::Population,
            interval: false,
            cut: false,
        });
    }
    let typical = population.unknowns()[1].1.quantile(0.5);
    Some(Population {
        name: name.to_owned(),
        form,
        members,
        groups: names,
        location: places[0],
        scale: places[1],
        typical,
        centred: section.coordinates.centred(),
    })
}

/// The groups of a section, in the order of the scenarios.
fn groups(
    section: &ParameterSection,
    scenarios: &[Scenario],
    path: &str,
    root: &Node,
    problems: &mut Problems,
) -> Option<Vec<Member>> {
    let by = section.by.as_deref()?;
    let mut complaints = Complaints::new(root, problems);
    if scenarios.iter().all(|scenario| scenario.label().is_none()) {
        complaints
            .at(&format!("{path}.by"))
            .say("the study has no scenarios that could be grouped")
            .expected("`[[scenario]]` sections, or `groups` in `[measurements]`")
            .found(format!("by = \"{by}\""));
        return None;
    }
    let mut groups: Vec<Member> = Vec::new();
    for (i, scenario) in scenarios.iter().enumerate() {
        let group = if by == SCENARIO { Some(&scenario.name) } else { scenario.labels.get(by) };
        let Some(group) = group else {
            let known = || scenarios.iter().flat_map(|s| s.labels.keys().map(String::as_str));
            let mut names: Vec<&str> = known().chain([SCENARIO]).collect();
            names.sort_unstable();
            names.dedup();
            let problem = complaints
                .at(&format!("{path}.by"))
                .say(format!("the scenario `{}` has no label `{by}`", scenario.name));
            problem.expected(one_of(names.iter().copied()));
            problem.found(format!("by = \"{by}\""));
            if let Some(near) = nearest(by, names.iter().copied()) {
                problem.help(format!("did you mean `{near}`?"));
            } else {
                problem.help(format!("add `labels = {{ {by} = … }}` to every `[[scenario]]`"));
            }
            return None;
        };
        if let Some(other) = groups.iter_mut().find(|other| other.group == *group) {
            other.scenarios.push(i);
        } else {
            let (by, group) = (by.to_owned(), group.clone());
            groups.push(Member { by, group, scenarios: vec![i] });
        }
    }
    Some(groups)
}
