//! A study as it is run: plugins built, priors and units checked, everything consistent.
//!
//! Three layers, each reporting all its problems before the next begins: *structure* (syntax, keys, types,
//! names of plugins), *context* (the sections against each other), *environment* (files and folders).

use std::path::{Path, PathBuf};

use toml::Table;

use super::context;
use super::decode::{decode, fields};
use super::fidelity::{LowFidelity, NumericalError, low_fidelity, numerical_error};
use super::file::{
    DerivedSection, DesignKeys, DiscrepancyKeys, EffectKeys, MeasurementKeys, ModelKeys,
    ResponseSection, SamplerKeys, SimulationKeys, StudySection, SurrogateKeys, ValidateSection,
};
use super::gap::{Gap, gap};
use super::libraries::{Libraries, Seen, libraries};
use super::sections::{
    chosen, chosen_or, derived, effects, layouts, name, parameters, scenarios, table,
    unknown_sections,
};
use super::unknowns::{Unknown, unknowns};
use super::{Node, Problems, Sources, Value, inherit, overrides, resolved, sizes};
use crate::data::{Layout, Layouts, Parameter, Scenario};
use crate::plugin::registry::loaded::declaring;
use crate::plugin::registry::{NoKeys, Section};
use crate::plugin::{
    Context, Density, Design, Discrepancy, Effect, Executor, Given, Model, Reader, Sampler,
    Surrogate,
};

/// A study that can be run.
pub struct Study {
    /// Its name: the one it gives itself, else the stem of its file.
    pub name: String,
    /// Whether it gives itself its name, in its file or on the command line; one that it inherits is another's.
    pub named: bool,
    /// Its file.
    pub file: PathBuf,
    /// The folder of its file; relative paths start there.
    pub directory: PathBuf,
    /// Its file, byte for byte.
    pub text: String,
    /// `[study]`.
    pub about: StudySection,
    /// `[plugins]`, with the libraries that were loaded.
    pub libraries: Libraries,
    /// The unknowns of the model.
    pub parameters: Vec<Parameter>,
    /// The known conditions; one without a name where the study has no scenarios.
    pub scenarios: Vec<Scenario>,
    /// What each parameter stands for.
    pub unknowns: Vec<Unknown>,
    /// What the study sets of the model's inputs.
    pub given: Vec<Given>,
    /// The shapes of the responses to all scenarios.
    pub layouts: Layouts,
    /// `[target]`.
    pub target: Option<Section<dyn Density, NoKeys>>,
    /// `[model]`.
    pub model: Option<Section<dyn Model, ModelKeys>>,
    /// `[design]`.
    pub design: Option<Section<dyn Design, DesignKeys>>,
    /// `[executor]`.
    pub executor: Option<Section<dyn Executor, NoKeys>>,
    /// `[simulations]`.
    pub simulations: Option<Section<dyn Reader, SimulationKeys>>,
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
    /// `[low_fidelity]`.
    pub low_fidelity: Option<LowFidelity>,
    /// `[[derived]]`.
    pub derived_sections: Vec<DerivedSection>,
    /// `[[effect]]`.
    pub effects: Vec<Section<dyn Effect, EffectKeys>>,
    /// `[validate]`.
    pub validate: ValidateSection,
    /// `[gap]`.
    pub gap: Gap,
    /// The whole study with every default filled in, for `resolved.toml`.
    pub resolved: Table,
}

/// The sections of the study language, in the order in which a study is written.
pub const SECTIONS: [&str; 20] = [
    "study",
    "plugins",
    "parameter",
    "target",
    "derived",
    "scenario",
    "response",
    "model",
    "design",
    "executor",
    "simulations",
    "measurements",
    "surrogate",
    "discrepancy",
    "numerical_error",
    "low_fidelity",
    "effect",
    "sampler",
    "validate",
    "gap",
];

/// A study that was looked at: the texts it comes from, what is wrong with it, and the study itself
/// when nothing is.
pub struct Checked {
    /// The texts.
    pub sources: Sources,
    /// What is wrong.
    pub problems: Problems,
    /// The libraries of plugins that the study loads.
    pub libraries: Vec<Seen>,
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
    load_for(path, arguments, Use::Run)
}

/// What a study is read for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// To run it: its model must be there.
    Run,
    /// To say what is wrong with it: no library of plugins is loaded, since that would run its code.
    Check,
    /// To look at what a run has kept: the model and the executor, which are not asked, may be gone.
    Look,
}

/// [`load`] for some use.
pub fn load_for(path: &Path, arguments: &[String], purpose: Use) -> Checked {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let root = inherit::load(path, &common_keys, &mut sources, &mut problems);
    let text = std::fs::read_to_string(path).unwrap_or_default();
    finish(path, text, root, arguments, purpose, sources, problems)
}

/// Checks a study given as text, as if it stood in a file at `path`.
pub fn load_text(path: &Path, text: &str, arguments: &[String]) -> Checked {
    text_for(path, text, arguments, Use::Run)
}

/// The same for some use, without arguments.
pub fn load_text_for(path: &Path, text: &str, purpose: Use) -> Checked {
    text_for(path, text, &[], purpose)
}

fn text_for(path: &Path, text: &str, arguments: &[String], purpose: Use) -> Checked {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let root = inherit::load_text(path, text.to_owned(), &common_keys, &mut sources, &mut problems);
    finish(path, text.to_owned(), root, arguments, purpose, sources, problems)
}

fn finish(
    path: &Path,
    text: String,
    root: Option<Node>,
    arguments: &[String],
    purpose: Use,
    mut sources: Sources,
    mut problems: Problems,
) -> Checked {
    let mut seen = Vec::new();
    let study = root.and_then(|mut root| {
        overrides::apply(&mut root, arguments, &common_keys, &mut sources, &mut problems);
        take_out(&mut root);
        let named = gives_its_name(path, &root, &sources);
        let libraries = libraries(&root, &directory(path, &root), purpose, &mut problems)?;
        seen.clone_from(&libraries.seen);
        let declared = if purpose == Use::Check { libraries.declared() } else { Vec::new() };
        declaring(declared, || {
            let mut study = structure(path, text, &root, libraries, &mut problems)?;
            study.named = named;
            if problems.is_empty() {
                context::check(&study, &root, &mut problems);
            }
            if problems.is_empty() {
                environment(&study, purpose, &root, &mut problems);
            }
            Some(study)
        })
    });
    let study = study.filter(|_| problems.is_empty());
    Checked { sources, problems, libraries: seen, study }
}

/// See [`Study::named`].
fn gives_its_name(path: &Path, root: &Node, sources: &Sources) -> bool {
    let source = root.find("study.name").map(|name| sources.get(name.place.source));
    source.is_some_and(|source| source.path.as_deref().is_none_or(|file| file == path))
}

/// Tables inside a section that a study may leave out.
const OPTIONAL: [(&str, &str); 3] =
    [("measurements", "screen"), ("surrogate", "refine"), ("sampler", "stop")];

/// Takes out what is `false` in the place of a section: `numerical_error = false` removes the section that another study
/// has, of which this one says what differs.
fn take_out(root: &mut Node) {
    let is_false = |node: Option<&Node>| node.is_some_and(|n| n.value == Value::Boolean(false));
    for name in SECTIONS {
        if is_false(root.get(name)) {
            root.remove(name);
        }
    }
    for (section, key) in OPTIONAL {
        if let Some(section) = root.get_mut(section)
            && is_false(section.get(key))
        {
            section.remove(key);
        }
    }
}

/// Where the relative paths of a study start. It is never empty: an empty path has no absolute one.
fn directory(path: &Path, root: &Node) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let given = root.find("study.directory").and_then(Node::as_str);
    given.map_or(folder.to_owned(), |given| folder.join(given))
}

/// The engine's own keys of a section, which stay when its plugin changes.
fn common_keys(section: &str) -> &'static [&'static str] {
    match section {
        "model" => fields::<ModelKeys>(),
        "design" => fields::<DesignKeys>(),
        "simulations" => fields::<SimulationKeys>(),
        "measurements" => fields::<MeasurementKeys>(),
        "surrogate" => fields::<SurrogateKeys>(),
        "discrepancy" => fields::<DiscrepancyKeys>(),
        "sampler" => fields::<SamplerKeys>(),
        // Elements of named lists, such as the parts of a chain.
        "" => &["name", "takes", "gives"],
        "effect" => fields::<EffectKeys>(),
        _ => &[],
    }
}

/// First layer: the sections, their keys and types, the names of the plugins.
fn structure(
    path: &Path,
    text: String,
    root: &Node,
    libraries: Libraries,
    problems: &mut Problems,
) -> Option<Study> {
    unknown_sections(root, problems);
    let about = table::<StudySection>(root, "study", problems);
    let parameters = parameters(root, problems);
    let response = match root.get("response") {
        // A target has no response, so that nothing is said of its shape.
        None if root.get("target").is_some() => Some(None),
        _ => table::<ResponseSection>(root, "response", problems).map(Some),
    };
    let directory = directory(path, root);
    let scenarios = scenarios(root, &directory, problems);
    let before = problems.len();
    let target = chosen(root, "target", None, problems);
    let model = chosen(root, "model", None, problems);
    let design: Option<Section<dyn Design, DesignKeys>> = chosen(root, "design", None, problems);
    let executor = chosen_or(root, "executor", "local", problems);
    let simulations = chosen(root, "simulations", None, problems);
    let measurements = chosen(root, "measurements", None, problems);
    let surrogate = chosen(root, "surrogate", None, problems);
    let discrepancy = chosen(root, "discrepancy", None, problems);
    let sampler = chosen(root, "sampler", None, problems);
    let numerical_error = numerical_error(root, problems);
    let low_fidelity = low_fidelity(root, problems);
    let derived_sections = derived(root, problems);
    let effects = effects(root, problems);
    let validate = match root.get("validate") {
        Some(node) => problems.within("validate", |problems| decode(node, problems)),
        None => Some(ValidateSection::default()),
    };
    let gap = gap(root, problems);
    let measured: Option<&Section<dyn Reader, MeasurementKeys>> = measurements.as_ref();
    let reader = measured.map(|section| &*section.built.plugin);
    let layouts = match (&response, &scenarios) {
        (Some(Some(response)), Some((_, sections))) => {
            layouts(response, sections, reader, &directory, root, problems)
        }
        (Some(None), _) => Some(Layout::number("log_density").into()),
        _ => None,
    };
    let (scenarios, sections) = scenarios?;
    let margin = design.as_ref().and_then(|design| design.common.margin);
    let (parameters, unknowns) = unknowns(&parameters?, &scenarios, margin, root, problems);
    if problems.len() > before {
        return None;
    }
    let mut about = about?;
    about.directory = None;
    let name = name(&mut about, path, root, problems)?;
    let mut study = Study {
        name,
        named: false,
        file: path.to_owned(),
        directory,
        text,
        about,
        libraries,
        parameters,
        scenarios,
        unknowns,
        given: Vec::new(),
        layouts: layouts?,
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
        low_fidelity,
        derived_sections: derived_sections?,
        effects: effects?,
        validate: validate?,
        gap: gap?,
        resolved: Table::new(),
    };
    study.given = study.all_given();
    match resolved::table(&study, response?.as_ref(), &sections) {
        Ok(resolved) => study.resolved = resolved,
        Err(error) => {
            problems.report(None, format!("the study with its defaults {error}"));
            return None;
        }
    }
    Some(study)
}

/// Third layer: what the plugins need of the machine.
fn environment(study: &Study, purpose: Use, root: &Node, problems: &mut Problems) {
    if purpose != Use::Look {
        sizes::environment(study, root, problems);
    }
    study.each_plugin(root, problems, |section, component, context, complaints| {
        if purpose != Use::Look
            || !["model", "numerical_error", "low_fidelity", "executor"].contains(&section)
        {
            let starts_programs = purpose != Use::Check;
            component.environment(&Context { starts_programs, ..*context }, complaints);
        }
    });
}
