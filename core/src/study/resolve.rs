//! A study as it is run: plugins built, priors and units checked, everything consistent.
//!
//! Three layers, each reporting all its problems before the next begins: *structure* (syntax, keys, types,
//! names of plugins), *context* (the sections against each other), *environment* (files and folders).

use std::path::{Path, PathBuf};

use toml::Table;

use super::context;
use super::decode::{decode, fields};
use super::file::{
    DesignKeys, DiscrepancyKeys, MeasurementKeys, ModelKeys, NumericalErrorSection,
    ParameterSection, ResponseSection, SamplerKeys, StudySection, SurrogateKeys, ValidateSection,
};
use super::{Complaints, Node, Problems, Sources, inherit, overrides, resolved};
use crate::data::{Layout, Parameter};
use crate::plugin::registry::{Kind, NoKeys, Section, section};
use crate::plugin::{
    Context, Density, Design, Discrepancy, Effect, Executor, Model, Reader, Sampler, Surrogate,
};

/// A study that can be run.
pub struct Study {
    /// Its name: the stem of its file.
    pub name: String,
    /// The folder of its file; relative paths start there.
    pub directory: PathBuf,
    /// Its file, byte for byte.
    pub text: String,
    /// `[study]`.
    pub about: StudySection,
    /// The unknowns of the model.
    pub parameters: Vec<Parameter>,
    /// The shape of the response.
    pub layout: Layout,
    /// `[target]`.
    pub target: Option<Section<dyn Density, NoKeys>>,
    /// `[model]`.
    pub model: Option<Section<dyn Model, ModelKeys>>,
    /// `[design]`.
    pub design: Option<Section<dyn Design, DesignKeys>>,
    /// `[executor]`.
    pub executor: Option<Section<dyn Executor, NoKeys>>,
    /// `[simulations]`.
    pub simulations: Option<Section<dyn Reader, NoKeys>>,
    /// `[measurements]`.
    pub measurements: Option<Section<dyn Reader, MeasurementKeys>>,
    /// `[surrogate]`.
    pub surrogate: Option<Section<dyn Surrogate, SurrogateKeys>>,
    /// `[discrepancy]`.
    pub discrepancy: Option<Section<dyn Discrepancy, DiscrepancyKeys>>,
    /// `[sampler]`.
    pub sampler: Option<Section<dyn Sampler, SamplerKeys>>,
    /// `[numerical_error]`.
    pub numerical_error: Option<NumericalError>,
    /// `[[effect]]`.
    pub effects: Vec<Section<dyn Effect, NoKeys>>,
    /// `[validate]`.
    pub validate: ValidateSection,
    /// The whole study with every default filled in, for `resolved.toml`.
    pub resolved: Table,
}

/// How the model's numerical error is estimated.
pub struct NumericalError {
    /// How many runs of the design are repeated.
    pub runs: usize,
    /// The model with finer numerics.
    pub model: Section<dyn Model, ModelKeys>,
    /// The section as it is written.
    pub written: NumericalErrorSection,
}

/// The sections of the study language, in the order in which a study is written.
pub const SECTIONS: [&str; 15] = [
    "study",
    "parameter",
    "target",
    "response",
    "model",
    "design",
    "executor",
    "simulations",
    "measurements",
    "surrogate",
    "discrepancy",
    "numerical_error",
    "effect",
    "sampler",
    "validate",
];

/// A study that was looked at: the texts it comes from, what is wrong with it, and the study itself
/// when nothing is.
pub struct Checked {
    /// The texts.
    pub sources: Sources,
    /// What is wrong.
    pub problems: Problems,
    /// The study, when nothing is wrong.
    pub study: Option<Study>,
}

impl Checked {
    /// All problems as text; empty when there is none.
    pub fn complaints(&self) -> String {
        self.problems.render(&self.sources)
    }
}

/// Reads a study file with `--set` arguments and checks all three layers.
pub fn load(path: &Path, arguments: &[String]) -> Checked {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let root = inherit::load(path, &common_keys, &mut sources, &mut problems);
    let text = std::fs::read_to_string(path).unwrap_or_default();
    finish(path, text, root, arguments, sources, problems)
}

/// Checks a study given as text, as if it stood in a file at `path`.
pub fn load_text(path: &Path, text: &str, arguments: &[String]) -> Checked {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let root = inherit::load_text(path, text.to_owned(), &common_keys, &mut sources, &mut problems);
    finish(path, text.to_owned(), root, arguments, sources, problems)
}

fn finish(
    path: &Path,
    text: String,
    root: Option<Node>,
    arguments: &[String],
    mut sources: Sources,
    mut problems: Problems,
) -> Checked {
    let study = root.and_then(|mut root| {
        overrides::apply(&mut root, arguments, &common_keys, &mut sources, &mut problems);
        let study = structure(path, text, &root, &mut problems)?;
        if problems.is_empty() {
            context::check(&study, &root, &mut problems);
        }
        if problems.is_empty() {
            environment(&study, &root, &mut problems);
        }
        Some(study)
    });
    let study = study.filter(|_| problems.is_empty());
    Checked { sources, problems, study }
}

/// The engine's own keys of a section, which stay when its plugin changes.
fn common_keys(section: &str) -> &'static [&'static str] {
    match section {
        "model" => fields::<ModelKeys>(),
        "design" => fields::<DesignKeys>(),
        "measurements" => fields::<MeasurementKeys>(),
        "surrogate" => fields::<SurrogateKeys>(),
        "discrepancy" => fields::<DiscrepancyKeys>(),
        "sampler" => fields::<SamplerKeys>(),
        _ => &[],
    }
}

/// First layer: the sections, their keys and types, the names of the plugins.
fn structure(path: &Path, text: String, root: &Node, problems: &mut Problems) -> Option<Study> {
    unknown_sections(root, problems);
    let about = table::<StudySection>(root, "study", problems);
    let parameters = parameters(root, problems);
    let response = match root.get("response") {
        // A target has no response, so that nothing is said of its shape.
        None if root.get("target").is_some() => Some(None),
        _ => table::<ResponseSection>(root, "response", problems).map(Some),
    };
    let layout = match &response {
        Some(Some(response)) => layout(response, root, problems),
        Some(None) => Some(Layout::number("log_density")),
        None => None,
    };
    let before = problems.len();
    let target = chosen(root, "target", None, problems);
    let model = chosen(root, "model", None, problems);
    let design = chosen(root, "design", None, problems);
    let executor = chosen_or(root, "executor", "local", problems);
    let simulations = chosen(root, "simulations", None, problems);
    let measurements = chosen(root, "measurements", None, problems);
    let surrogate = chosen(root, "surrogate", None, problems);
    let discrepancy = chosen(root, "discrepancy", None, problems);
    let sampler = chosen(root, "sampler", None, problems);
    let numerical_error = numerical_error(root, problems);
    let effects = effects(root, problems);
    let validate = match root.get("validate") {
        Some(node) => problems.within("validate", |problems| decode(node, problems)),
        None => Some(ValidateSection::default()),
    };
    if problems.len() > before {
        return None;
    }
    let mut about = about?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let directory = about.directory.take().map_or(folder.clone(), |given| folder.join(given));
    let mut study = Study {
        name: about.name.take().unwrap_or(stem),
        directory,
        text,
        about,
        parameters: parameters?.iter().map(parameter).collect(),
        layout: layout?,
        target,
        model,
        design,
        executor,
        simulations,
        measurements,
        surrogate,
        discrepancy,
        sampler,
        numerical_error,
        effects: effects?,
        validate: validate?,
        resolved: Table::new(),
    };
    match resolved::table(&study, response?.as_ref()) {
        Ok(resolved) => study.resolved = resolved,
        Err(error) => {
            problems.report(None, format!("the study with its defaults {error}"));
            return None;
        }
    }
    Some(study)
}

fn unknown_sections(root: &Node, problems: &mut Problems) {
    for (key, _) in root.entries() {
        if !SECTIONS.contains(&key.name.as_str()) {
            let problem =
                problems.report(Some(key.place.clone()), format!("unknown section `{}`", key.name));
            problem.expected(super::nearest::one_of(SECTIONS));
            if let Some(near) = super::nearest::nearest(&key.name, SECTIONS) {
                problem.help(format!("did you mean `{near}`?"));
            }
        }
    }
}

fn table<T: serde::de::DeserializeOwned>(
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

fn chosen<K: Kind + ?Sized, C: serde::de::DeserializeOwned>(
    root: &Node,
    name: &str,
    default: Option<&str>,
    problems: &mut Problems,
) -> Option<Section<K, C>> {
    let node = root.get(name)?;
    problems.within(name, |problems| section(node, default, problems))
}

/// A section that is there even when it is not written.
fn chosen_or<K: Kind + ?Sized, C: serde::de::DeserializeOwned>(
    root: &Node,
    name: &str,
    default: &str,
    problems: &mut Problems,
) -> Option<Section<K, C>> {
    let unwritten = Node::table(root.place.clone());
    let node = root.get(name).unwrap_or(&unwritten);
    problems.within(name, |problems| section(node, Some(default), problems))
}

fn parameters(root: &Node, problems: &mut Problems) -> Option<Vec<ParameterSection>> {
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
fn numerical_error(root: &Node, problems: &mut Problems) -> Option<NumericalError> {
    let node = root.get("numerical_error")?;
    problems.within("numerical_error", |problems| {
        let written: NumericalErrorSection = decode(node, problems)?;
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

fn effects(root: &Node, problems: &mut Problems) -> Option<Vec<Section<dyn Effect, NoKeys>>> {
    let list = root.get("effect").map(Node::elements).unwrap_or_default();
    let decoded: Vec<Option<_>> = list
        .iter()
        .map(|node| problems.within("effect", |problems| section(node, None, problems)))
        .collect();
    decoded.into_iter().collect()
}

fn parameter(section: &ParameterSection) -> Parameter {
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

fn layout(section: &ResponseSection, root: &Node, problems: &mut Problems) -> Option<Layout> {
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

/// Third layer: what the plugins need of the machine.
fn environment(study: &Study, root: &Node, problems: &mut Problems) {
    study.each_plugin(root, problems, |component, context, complaints| {
        component.environment(context, complaints);
    });
}

impl Study {
    /// What a plugin sees of the study.
    pub fn context(&self) -> Context<'_> {
        let made = self.design.as_ref().map(|design| design.common.runs.get());
        let kept = self.surrogate.as_ref().map_or(0, |s| s.common.validation);
        let training = self.surrogate.as_ref().and_then(|s| s.common.training).map(usize::from);
        let runs = training.or_else(|| made.map(|made| made.saturating_sub(kept)));
        let emulator = self.discrepancy.as_ref().is_some_and(|d| d.common.emulator_error);
        Context {
            directory: &self.directory,
            parameters: &self.parameters,
            layout: &self.layout,
            runs,
            common_errors: self.numerical_error.is_some() || emulator,
        }
    }

    /// Calls `look` for every plugin with complaints about its own section.
    pub(super) fn each_plugin(
        &self,
        root: &Node,
        problems: &mut Problems,
        look: impl Fn(&dyn crate::plugin::Component, &Context<'_>, &mut Complaints<'_>),
    ) {
        let context = self.context();
        let mut visit =
            |name: &str, node: Option<&Node>, component: &dyn crate::plugin::Component| {
                let unwritten = Node::table(root.place.clone());
                let node = node.unwrap_or(&unwritten);
                problems.within(name, |problems| {
                    look(component, &context, &mut Complaints::new(node, problems));
                });
            };
        macro_rules! visit_sections {
            ($($field:ident),+) => {
                $(if let Some(section) = &self.$field {
                    visit(stringify!($field), root.get(stringify!($field)), &*section.built.plugin);
                })+
            };
        }
        visit_sections!(
            target,
            model,
            design,
            executor,
            simulations,
            measurements,
            surrogate,
            discrepancy,
            sampler
        );
        let nodes = root.get("effect").map(Node::elements).unwrap_or_default();
        for (section, node) in self.effects.iter().zip(nodes) {
            visit("effect", Some(node), &*section.built.plugin);
        }
        if let Some(finer) = &self.numerical_error {
            visit("numerical_error", root.get("numerical_error"), &*finer.model.built.plugin);
        }
    }
}
