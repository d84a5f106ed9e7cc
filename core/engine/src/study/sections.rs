//! The sections of a study file, decoded one by one.

use std::collections::BTreeSet;
use std::path::Path;

use lacuna::data::{Axis, Layout, Layouts, Scenario, Unit};
use lacuna::plugin::reader::GridSource;
use lacuna::plugin::registry::{Section, section};
use lacuna::plugin::{Effect, Reader};
use lacuna::text::decode::decode;
use lacuna::text::file_name::FileName;
use lacuna::text::{Complaints, Node, Problems, nearest};
use serde::de::DeserializeOwned;

use super::field::FieldSection;
use super::file::{
    Axes, DerivedSection, EffectKeys, ParameterSection, ResponseSection, ScenarioSection,
    StudySection,
};
use super::quantity::QuantitySection;
use super::reliability::ReliabilitySection;
use super::sizes;
use super::start::StartSection;
use super::table::SECTIONS;

pub(super) fn unknown_sections(root: &Node, problems: &mut Problems) {
    for (key, _) in root.entries() {
        if !SECTIONS.contains(&key.name.as_str()) {
            let problem =
                problems.report(Some(key.place.clone()), format!("unknown section `{}`", key.name));
            problem.expected(nearest::one_of(SECTIONS.iter().copied()));
            if let Some(near) = nearest::nearest(&key.name, SECTIONS.iter().copied()) {
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

pub(super) fn parameters(root: &Node, problems: &mut Problems) -> Option<Vec<ParameterSection>> {
    let list = root.get("parameter").map(Node::elements).unwrap_or_default();
    if list.is_empty() && root.get("field").is_none() {
        let place = root.get("parameter").map_or(&root.place, |node| &node.place).clone();
        problems
            .report(Some(place), "the study has no unknowns")
            .expected("at least one `[[parameter]]` with `name` and `prior`");
        return None;
    }
    named(root, "parameter", problems, decode)
}

/// The tables of a list, each decoded under its name.
fn named<T>(
    root: &Node,
    list: &str,
    problems: &mut Problems,
    decode: impl Fn(&Node, &mut Problems) -> Option<T>,
) -> Option<Vec<T>> {
    let elements = root.get(list).map(Node::elements).unwrap_or_default();
    let decoded: Vec<Option<T>> = elements
        .iter()
        .map(|node| {
            let path = format!("{list}.{}", node.name().unwrap_or("?"));
            problems.within(&path, |problems| decode(node, problems))
        })
        .collect();
    decoded.into_iter().collect()
}

pub(super) fn effects(
    root: &Node,
    problems: &mut Problems,
) -> Option<Vec<Section<dyn Effect, EffectKeys>>> {
    let list = root.get("effect").map(Node::elements).unwrap_or_default();
    let decoded: Vec<Option<_>> = list
        .iter()
        .map(|node| problems.within("effect", |problems| section(node, None, problems)))
        .collect();
    decoded.into_iter().collect()
}

/// `[[quantity]]`.
pub(super) fn quantities(root: &Node, problems: &mut Problems) -> Option<Vec<QuantitySection>> {
    named(root, "quantity", problems, |node, problems| section(node, None, problems))
}

/// `[[field]]`.
pub(super) fn fields(root: &Node, problems: &mut Problems) -> Option<Vec<FieldSection>> {
    named(root, "field", problems, decode)
}

/// `[[start]]`.
pub(super) fn starts(root: &Node, problems: &mut Problems) -> Option<Vec<StartSection>> {
    named(root, "start", problems, decode)
}

/// `[[reliability]]`.
pub(super) fn reliability(root: &Node, problems: &mut Problems) -> Option<Vec<ReliabilitySection>> {
    named(root, "reliability", problems, |node, problems| section(node, None, problems))
}

/// `[[derived]]`.
pub(super) fn derived(root: &Node, problems: &mut Problems) -> Option<Vec<DerivedSection>> {
    named(root, "derived", problems, decode)
}

/// `[[scenario]]`: one without a name where there is none.
pub(super) fn scenarios(
    root: &Node,
    directory: &Path,
    problems: &mut Problems,
) -> Option<(Vec<Scenario>, Vec<ScenarioSection>)> {
    let list = root.get("scenario").map(Node::elements).unwrap_or_default();
    if list.is_empty() {
        return Some((vec![Scenario::default()], Vec::new()));
    }
    let (mut scenarios, mut sections): (Vec<Scenario>, Vec<ScenarioSection>) = Default::default();
    for node in list {
        let path = format!("scenario.{}", node.name().unwrap_or("?"));
        problems.within(&path, |problems| {
            let section: ScenarioSection = decode(node, problems)?;
            let twice = sections.iter().any(|other| other.name == section.name);
            // Its name stands in those of files and of what is in them.
            let plain = FileName::new(section.name.as_str());
            let wrong = if let Err(unfit) = plain {
                Some(format!("a scenario cannot be called this: {unfit}"))
            } else if section.name == "each" {
                Some("a scenario cannot be called this".to_owned())
            } else {
                twice.then(|| format!("there are two scenarios `{}`", section.name))
            };
            if let Some(wrong) = wrong {
                Complaints::new(node, problems)
                    .at("name")
                    .say(wrong)
                    .expected("a name of its own for each `[[scenario]]`");
                return None;
            }
            let scenario = section.read(directory, &mut |key, reason| {
                Complaints::new(node, problems).at(key).say(reason);
            })?;
            scenarios.push(scenario);
            sections.push(section);
            Some(())
        });
    }
    (sections.len() == list.len()).then_some((scenarios, sections))
}

/// The shapes of the responses to all scenarios; the measurements say where they were taken, if asked.
pub(super) fn layouts(
    response: &ResponseSection,
    scenarios: &[ScenarioSection],
    reader: Option<&dyn Reader>,
    directory: &Path,
    root: &Node,
    problems: &mut Problems,
) -> Option<Layouts> {
    let node = root.get("response")?;
    let own = &response.axes;
    let shape = |axes| Layout {
        name: response.name.as_str().to_owned(),
        unit: response.unit.clone(),
        axes,
    };
    let faulty = reader.is_none() && root.get("measurements").is_some();
    if scenarios.is_empty() {
        let grids = Grids { reader, directory, scenario: None, measured: true, faulty };
        let axes = problems.within("response", |problems| grids.axes(own, node, problems))?;
        let before = problems.len();
        problems.within("response", |problems| {
            sizes::response(axes.iter().map(Axis::len), node, problems);
        });
        if problems.len() > before {
            return None;
        }
        return Some(shape(axes).into());
    }
    let sections = root.get("scenario").map(Node::elements).unwrap_or_default();
    let mut layouts = Vec::new();
    for (scenario, section) in scenarios.iter().zip(sections) {
        let mut axes = own.clone();
        for (name, axis) in &scenario.axes.0 {
            match axes.0.iter_mut().find(|(other, _)| other == name) {
                Some((_, other)) => *other = axis.clone(),
                None => axes.0.push((name.clone(), axis.clone())),
            }
        }
        let name = Some(scenario.name.as_str());
        let measured = scenario.measured;
        let grids = Grids { reader, directory, scenario: name, measured, faulty };
        let overridden =
            |path: &str| scenario.axes.0.iter().any(|(n, _)| path.ends_with(n.as_str()));
        let found = problems.within(&format!("scenario.{}", scenario.name), |problems| {
            let from = |path: &str| if overridden(path) { section } else { node };
            grids.axes_from(&axes, from, problems)
        });
        let (found, before) = (found?, problems.len());
        problems.within(&format!("scenario.{}", scenario.name), |problems| {
            sizes::response(found.iter().map(Axis::len), section, problems);
        });
        if problems.len() > before {
            return None;
        }
        layouts.push((scenario.name.as_str(), shape(found)));
    }
    let kinds: BTreeSet<&str> =
        scenarios.iter().flat_map(|scenario| scenario.labels.keys().map(String::as_str)).collect();
    let group = |name: &str, kind: &str| -> Option<&str> {
        let scenario = scenarios.iter().find(|scenario| scenario.name == name)?;
        scenario.labels.get(kind).map(String::as_str)
    };
    let kinds: Vec<&str> = kinds.into_iter().collect();
    Some(Layouts::of_scenarios(layouts).grouped(&kinds, group))
}

/// Source of axis coordinates that are taken from the measurements.
struct Grids<'a> {
    reader: Option<&'a dyn Reader>,
    directory: &'a Path,
    scenario: Option<&'a str>,
    measured: bool,
    /// True if the study has `[measurements]` with a fault, which is told there.
    faulty: bool,
}

impl Grids<'_> {
    fn axes(&self, axes: &Axes, node: &Node, problems: &mut Problems) -> Option<Vec<Axis>> {
        self.axes_from(axes, |_| node, problems)
    }

    fn axes_from<'n>(
        &self,
        axes: &Axes,
        node: impl Fn(&str) -> &'n Node,
        problems: &mut Problems,
    ) -> Option<Vec<Axis>> {
        let mut found = Vec::new();
        for (name, axis) in &axes.0 {
            let path = format!("axes.{}", name.as_str());
            let mut needs_measurements = false;
            let made = axis.axis(name.as_str(), |unit| {
                needs_measurements = true;
                self.measured(name.as_str(), unit)
            });
            match made {
                Ok(axis) => found.push(axis),
                Err(_) if needs_measurements && self.faulty => {}
                Err(reason) => {
                    let message = format!("the axis `{}`: {reason}", name.as_str());
                    Complaints::new(node(&path), problems).at(&path).say(message);
                }
            }
        }
        (found.len() == axes.0.len()).then_some(found)
    }

    fn measured(&self, name: &str, unit: &Unit) -> Result<Vec<f64>, String> {
        if !self.measured {
            let text = "the scenario has no measurements that could give its numbers: state them in its `axes`";
            return Err(text.to_owned());
        }
        let reader =
            self.reader.ok_or("the study has no measurements that could give its numbers")?;
        let source =
            GridSource { directory: self.directory, scenario: self.scenario, axis: name, unit };
        reader.grid(&source).map_err(|error| error.to_string())
    }
}

/// Name of the study: `name` of `[study]`, else the stem of its file.
pub(super) fn name(
    about: &mut StudySection,
    path: &Path,
    root: &Node,
    problems: &mut Problems,
) -> Option<String> {
    if let Some(name) = about.name.take() {
        return Some(name.into());
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    match FileName::new(stem) {
        Ok(name) => Some(name.into()),
        Err(unfit) => {
            Complaints::new(root, problems)
                .at("study")
                .say("the name of the study's file cannot be that of its run directory")
                .expected(unfit.expected)
                .found(unfit.found)
                .help("say `name` in `[study]`");
            None
        }
    }
}
