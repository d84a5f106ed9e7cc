//! From a file to a study that can be run, or to what is wrong with it.
//!
//! Three layers, each reporting all its problems before the next begins: *structure* (syntax, keys, types,
//! names of plugins), *context* (the sections against each other), *environment* (files and folders).

use std::path::{Path, PathBuf};

use lacuna::data::{Layout, Scenario};
use lacuna::plugin::Context;
use lacuna::plugin::registry::loaded::declaring;
use lacuna::text::decode::decode;
use lacuna::text::{Complaints, Node, Problems, Sources, Value};
use toml::Table;

use super::dependence::{Sections, dependence};
use super::fidelity::{low_fidelity, numerical_error};
use super::field::{enter, fields};
use super::file::{OPTIONAL, ParameterSection, ResponseSection, StudySection, ValidateSection};
use super::forward::forward;
use super::gap::companion::{Companion, companion};
use super::gap::gap;
use super::hierarchy::{Hierarchy, groups_as_scenarios, trained};
pub use super::libraries::Use;
use super::libraries::{Libraries, Seen, libraries};
pub use super::plain::Study;
use super::positions::positions;
use super::predict::as_scenarios;
use super::sections::{
    derived, effects, layouts, name, parameters, quantities, reliability, scenarios, starts, table,
    unknown_sections,
};
use super::table::{self, PluginSections, SECTIONS};
use super::unknowns::unknowns;
use super::{context, inherit, inputs, overrides, resolved, sizes};

/// A study that was looked at: the texts it comes from, what is wrong with it, and the study itself
/// when nothing is.
pub struct Checked {
    /// The texts.
    pub sources: Sources,
    /// Problems found.
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

/// Like [`load`], but for a given purpose.
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

/// Like [`load_text`], but for a given purpose and without arguments.
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
        let run = path.parent().unwrap_or(Path::new("."));
        let folders = (run, &*directory(path, &root));
        let libraries = libraries(&root, folders, purpose, &mut problems)?;
        seen.clone_from(&libraries.seen);
        let is_declared = purpose == Use::Check || !libraries.absent.is_empty();
        let declared = if is_declared { libraries.declared() } else { Vec::new() };
        declaring(declared, || {
            let folder = directory(path, &root);
            groups_as_scenarios(&mut root, &folder, &mut problems);
            as_scenarios(&mut root, &mut problems);
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

/// Folder from which relative paths of a study start. It is never empty, because an empty path has no absolute form.
fn directory(path: &Path, root: &Node) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let given = root.find("study.directory").and_then(Node::as_str);
    given.map_or(folder.to_owned(), |given| folder.join(given))
}

/// The engine's own keys of a section, which stay when its plugin changes.
fn common_keys(section: &str) -> &'static [&'static str] {
    match section {
        // Elements of named lists, such as the parts of a chain.
        "" => &["name", "takes", "gives"],
        _ => table::common_keys(section),
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
    let dependence_sections = Sections::read(root, problems);
    let response = match root.get("response") {
        // A target has no response, so that nothing is said of its shape.
        None if root.get("target").is_some() => Some(None),
        _ => table::<ResponseSection>(root, "response", problems).map(Some),
    };
    let directory = directory(path, root);
    let scenarios = scenarios(root, &directory, problems);
    let fields = fields(root, &directory, problems);
    let before = problems.len();
    let plugins = PluginSections::read(root, problems);
    let numerical_error = numerical_error(root, problems);
    let low_fidelity = low_fidelity(root, problems);
    let starts = starts(root, problems);
    let derived_sections = derived(root, problems);
    let effects = effects(root, problems);
    let quantities = quantities(root, problems);
    let forward = forward(root, problems);
    let reliability = reliability(root, problems);
    let validate = match root.get("validate") {
        Some(node) => problems.within("validate", |problems| decode(node, problems)),
        None => Some(ValidateSection::default()),
    };
    let gap = gap(root, problems);
    let reader = plugins.measurements.as_ref().map(|section| &*section.built.plugin);
    let layouts = match (&response, &scenarios) {
        (Some(Some(response)), Some((_, sections))) => {
            layouts(response, sections, reader, &directory, root, problems)
        }
        (Some(None), _) => Some(Layout::number("log_density").into()),
        _ => None,
    };
    let positions = match (&response, &scenarios) {
        (Some(Some(response)), Some((_, sections))) => {
            positions(response, sections, root, problems)
        }
        _ => Some(Vec::new()),
    };
    let (mut scenarios, sections) = scenarios?;
    let (sections_of_parameters, mut dependence_sections) = (parameters?, dependence_sections?);
    dependence_sections.read_runs(&sections_of_parameters, &directory, root, problems);
    let prior = |section: &ParameterSection| dependence_sections.prior(section);
    let (mut parameters, mut unknowns, drawn) =
        unknowns(&sections_of_parameters, &scenarios, &plugins, prior, root, problems);
    if problems.len() > before {
        return None;
    }
    let (field_sections, fields) = fields?;
    enter(&fields, &mut scenarios, (&mut parameters, &mut unknowns));
    let mut about = about?;
    let own = (parameters.as_slice(), unknowns.as_slice(), fields.as_slice());
    let dependence = dependence(&dependence_sections, drawn, own, about.seed, root, problems)?;
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
        dependence,
        dependence_sections,
        fields,
        field_sections,
        hierarchy: Hierarchy::of(sections_of_parameters),
        unknowns,
        given: Vec::new(),
        layouts: layouts?,
        positions: positions?,
        plugins,
        numerical_error,
        low_fidelity,
        starts: starts?,
        derived_sections: derived_sections?,
        effects: effects?,
        quantities: quantities?,
        forward,
        reliability: reliability?,
        validate: validate?,
        gap: gap?,
        resolved: Table::new(),
    };
    study.given = inputs::all_given(&study);
    study.hierarchy.trained = trained(&study, root);
    if let Some(node) = root.find("gap.companion") {
        study.gap.companion = Some(Box::new(companion_of(&study, node, problems)?));
    }
    let resolved = resolved::table(&study, response?.as_ref(), &sections).map_err(|error| {
        problems.report(None, format!("the study with its defaults {error}"));
    });
    study.resolved = resolved.ok()?;
    Some(study)
}

/// `[gap.companion]`.
fn companion_of(study: &Study, node: &Node, problems: &mut Problems) -> Option<Companion> {
    problems.within("gap", |problems| {
        problems.within("companion", |problems| companion(study, node, problems))
    })
}

/// Third layer: what the plugins need of the machine.
fn environment(study: &Study, purpose: Use, root: &Node, problems: &mut Problems) {
    if purpose != Use::Look {
        sizes::environment(study, root, problems);
    }
    let measured: Vec<Scenario> =
        study.scenarios.iter().filter(|scenario| !scenario.unmeasured).cloned().collect();
    context::each_plugin(study, root, problems, |section, component, context, complaints| {
        let scenarios =
            if section == "measurements" { measured.as_slice() } else { context.scenarios };
        if purpose != Use::Look
            || !["model", "numerical_error", "low_fidelity", "executor", "cases"].contains(&section)
        {
            let starts_programs = purpose != Use::Check;
            component.environment(&Context { starts_programs, scenarios, ..*context }, complaints);
        }
    });
    if purpose != Use::Look {
        // A model on a server is asked, unless its environment said that it must not.
        context::gradients::of_model(study, &mut Complaints::new(root, problems));
    }
}
