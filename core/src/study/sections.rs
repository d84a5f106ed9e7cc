//! The sections of a study file, decoded one by one.

use serde::de::DeserializeOwned;

use super::decode::decode;
use super::file::{ModelKeys, NumericalErrorSection, ParameterSection, ResponseSection};
use super::resolve::{NumericalError, SECTIONS};
use super::{Complaints, Node, Problems, nearest};
use crate::data::{Layout, Parameter};
use crate::plugin::registry::{Kind, NoKeys, Section, section};
use crate::plugin::{Effect, Given, Model};

pub(super) fn unknown_sections(root: &Node, problems: &mut Problems) {
    for (key, _) in root.entries() {
        if !SECTIONS.contains(&key.name.as_str()) {
            let problem =
                problems.report(Some(key.place.clone()), format!("unknown section `{}`", key.name));
            problem.expected(nearest::one_of(SECTIONS));
            if let Some(near) = nearest::nearest(&key.name, SECTIONS) {
                problem.help(format!("did you mean `{near}`?"));
            }
        }
    }
}

pub(super) fn table<T: DeserializeOwned>(
    root: &Node,
    name: &str,
    problems: &mut Problems,
) -> Option<T> {
    let Some(node) = root.get(name) else {
        problems.report(Some(root.place.clone()), format!("the study has no `[{name}]`"));
        return None;
    };
    problems.within(name, |problems| decode(node, problems))
}

pub(super) fn chosen<K: Kind + ?Sized, C: DeserializeOwned>(
    root: &Node,
    name: &str,
    default: Option<&str>,
    problems: &mut Problems,
) -> Option<Section<K, C>> {
    let node = root.get(name)?;
    problems.within(name, |problems| section(node, default, problems))
}

/// A section that is there even when it is not written.
pub(super) fn chosen_or<K: Kind + ?Sized, C: DeserializeOwned>(
    root: &Node,
    name: &str,
    default: &str,
    problems: &mut Problems,
) -> Option<Section<K, C>> {
    let unwritten = Node::table(root.place.clone());
    let node = root.get(name).unwrap_or(&unwritten);
    problems.within(name, |problems| section(node, Some(default), problems))
}

pub(super) fn parameters(root: &Node, problems: &mut Problems) -> Option<Vec<ParameterSection>> {
    let list = root.get("parameter").map(Node::elements).unwrap_or_default();
    if list.is_empty() {
        let place = root.get("parameter").map_or(&root.place, |node| &node.place).clone();
        problems
            .report(Some(place), "the study has no unknowns")
            .expected("at least one `[[parameter]]` with `name` and `prior`");
        return None;
    }
    let decoded: Vec<Option<ParameterSection>> = list
        .iter()
        .map(|node| {
            let name = format!("parameter.{}", node.name().unwrap_or("?"));
            problems.within(&name, |problems| decode(node, problems))
        })
        .collect();
    decoded.into_iter().collect()
}

/// `[numerical_error]`: the study's model with some options changed.
pub(super) fn numerical_error(root: &Node, problems: &mut Problems) -> Option<NumericalError> {
    let node = root.get("numerical_error")?;
    problems.within("numerical_error", |problems| {
        let written: NumericalErrorSection = decode(node, problems)?;
        if written.ratio.get() <= 1.0 {
            let place = node.get("ratio").unwrap_or(node).place.clone();
            let found = written.ratio.get();
            problems
                .report(Some(place), "the finer runs are no finer")
                .expected("a `ratio` above 1")
                .found(found.to_string());
            return None;
        }
        let Some(base) = root.get("model") else {
            problems.report(Some(node.place.clone()), "the study has no model to run finer");
            return None;
        };
        let mut finer = base.clone();
        overlay(&mut finer, node.get("model")?);
        let model = problems.within("model", |problems| section(&finer, None, problems))?;
        Some(NumericalError { runs: written.runs.get(), model, written })
    })
}

/// Puts the values of `over` in the place of those of `base`, table by table.
fn overlay(base: &mut Node, over: &Node) {
    for (key, value) in over.entries() {
        match base.get_mut(&key.name) {
            Some(old) if !old.entries().is_empty() && !value.entries().is_empty() => {
                overlay(old, value);
            }
            _ => base.set(key.clone(), value.clone()),
        }
    }
}

pub(super) fn effects(
    root: &Node,
    problems: &mut Problems,
) -> Option<Vec<Section<dyn Effect, NoKeys>>> {
    let list = root.get("effect").map(Node::elements).unwrap_or_default();
    let decoded: Vec<Option<_>> = list
        .iter()
        .map(|node| problems.within("effect", |problems| section(node, None, problems)))
        .collect();
    decoded.into_iter().collect()
}

pub(super) fn parameter(section: &ParameterSection) -> Parameter {
    let name = section.name.as_str().to_owned();
    Parameter {
        symbol: section.symbol.clone().unwrap_or_else(|| name.clone()),
        name,
        unit: section.unit.clone(),
        design: section.design.clone().unwrap_or_else(|| section.prior.clone()),
        prior: section.prior.clone(),
        reference: section.reference,
    }
}

/// What a study sets of its model's inputs.
pub(super) fn given(
    parameters: &[Parameter],
    model: Option<&Section<dyn Model, ModelKeys>>,
) -> Vec<Given> {
    let set = |p: &Parameter| Given { name: p.name.clone(), unit: Some(p.unit.clone()) };
    let fixed = model.into_iter().flat_map(|model| model.common.fixed.keys());
    let fixed = fixed.map(|name| Given { name: name.clone(), unit: None });
    parameters.iter().map(set).chain(fixed).collect()
}

pub(super) fn layout(
    section: &ResponseSection,
    root: &Node,
    problems: &mut Problems,
) -> Option<Layout> {
    let mut axes = Vec::new();
    let node = root.get("response")?;
    problems.within("response", |problems| {
        for (name, axis) in &section.axes.0 {
            let path = format!("axes.{}", name.as_str());
            match axis.axis(name.as_str()) {
                Ok(axis) => axes.push(axis),
                Err(reason) => {
                    let message = format!("the axis `{}`: {reason}", name.as_str());
                    Complaints::new(node, problems).at(&path).say(message);
                }
            }
        }
    });
    let whole = axes.len() == section.axes.0.len();
    let name = section.name.as_str().to_owned();
    whole.then(|| Layout { name, unit: section.unit.clone(), axes })
}
