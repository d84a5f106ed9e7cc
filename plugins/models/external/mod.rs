//! `external`: any command as a simulator.

mod answer;
mod check;
mod folder;
mod number;
mod output;
mod run;
mod template;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lacuna::data::Unit;
use lacuna::plugin::abi::Library;
use lacuna::plugin::model::{Call, EvalError, Response, Signature};
use lacuna::plugin::{Component, Context, Fact, Fault, Model};
use lacuna::study::problem::Complaints;
use lacuna::study::values::Positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::folder::Folder;
pub use self::output::Output;
pub use self::template::Template;
use super::given;

/// Runs any command as the simulator: Sierra, ABAQUS, an in-house code, a script.
///
/// ```toml
/// [model]
/// use = "external"
/// command = ["sierra", "adagio", "-i", "deck.i"]
/// templates = [{ from = "deck.i.template", to = "deck.i" }]
/// copy = ["target.g"]
/// output = { use = "sierra", path = "strain.h", variable = "strain_{sensor}" }
/// timeout = 3600
/// success = { file = "deck.log", contains = ["Normal termination"] }
/// ```
///
/// Every run has a folder of its own, in which the command is started; what it prints is kept there in
/// `stdout.txt` and `stderr.txt`. The inputs are all that the study gives (parameters, fixed values, values of a
/// scenario), in the study's units or in those of `units`. They reach the command through **templates**,
/// in which `{{ density }}` stands for a value and `{{ density | %.6e }}` for the same in a format of C's `printf`
/// (flags, width and precision with `e`, `f`, `g`, `E`, `G`); without a format it is the shortest text that reads
/// back as the same number. `{{ run }}` is the run's name, `{{ scenario }}` the scenario's, `{{ study }}` the
/// folder of the study. The words of `command` and the values of `environment` are templates too. Or
/// they reach it as **JSON** on standard input: `{"run": …, "inputs": {name: value}, "scenario": {"name": …,
/// "values": {…}, "functions": {…}}, "layout": {"name": …, "unit": …, "axes": […]}}`.
///
/// A run that does not end well (exit code, `success`, `timeout`, output that is missing, damaged or not
/// finite) is tried again `retries` times, then counts as failed with its reason; the study goes on.
/// When a run has ended, for whatever reason, all processes that it started are ended.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct External {
    /// The program and its arguments, one word each. A program with a `/` is relative to the study file,
    /// any other is looked up in `PATH`. No shell is involved unless it is named: `["sh", "-c", "…"]`.
    pub command: Vec<Template>,
    /// Where the response is: `"json"`, or a table with a reader and the file: `use`, `path` relative to the run's
    /// folder, and the reader's options. JSON is printed to standard output as the only or the last line: nested lists
    /// in the order of the axes, one flat list, or objects by label.
    pub output: Output,
    /// Files made from templates: a list of `{ from = "deck.template", to = "deck.i" }`, the first relative to the
    /// study file, the second to the run's folder.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub templates: Vec<TemplateFile>,
    /// What the command finds on its standard input.
    #[serde(default)]
    pub input: Input,
    /// Files and folders that are copied into each run's folder, relative to the study file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub copy: Vec<PathBuf>,
    /// Files and folders to which each run's folder has a link, such as a large mesh, relative to the study file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub link: Vec<PathBuf>,
    /// Variables of the command's environment, beside those that Lacuna was started with.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub environment: BTreeMap<String, Template>,
    /// Units in which the command takes inputs, where they are not the study's.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, Unit>,
    /// Seconds after which an attempt is stopped; no limit when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeout: Option<Positive>,
    /// When an attempt has gone well.
    #[serde(default)]
    pub success: Success,
    /// How often a run that failed is tried again. With retries the attempts have folders `attempt1`, `attempt2`, …
    /// in the run's folder.
    #[serde(default)]
    pub retries: usize,
    /// Which folders of runs stay when the run has ended.
    #[serde(default)]
    pub keep: Keep,
}

/// A file that is made for each run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TemplateFile {
    /// The template, relative to the study file.
    pub from: PathBuf,
    /// The file that is made of it, relative to the run's folder.
    pub to: PathBuf,
}

/// What a command finds on its standard input.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Input {
    /// Nothing.
    #[default]
    None,
    /// One JSON object with the inputs.
    Json,
}

/// When an attempt has gone well.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Success {
    /// The exit codes of a run that went well.
    pub exit_codes: Vec<i32>,
    /// The file that tells, relative to the run's folder.
    pub file: PathBuf,
    /// Texts each of which stands in that file when all went well.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contains: Vec<String>,
    /// Texts none of which stands in that file when all went well.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lacks: Vec<String>,
}

impl Default for Success {
    fn default() -> Self {
        let file = PathBuf::from(run::STDOUT);
        Self { exit_codes: vec![0], file, contains: Vec::new(), lacks: Vec::new() }
    }
}

/// Which folders of runs stay.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// Those of all runs.
    #[default]
    All,
    /// Those of runs that failed.
    Failed,
    /// None.
    None,
}

impl Component for External {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        check::options(self, context, complaints);
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        check::files(self, context, complaints);
    }

    fn faults(&self) -> Vec<Arc<Fault>> {
        self.output.file().map_or_else(Vec::new, output::File::faults)
    }

    fn libraries(&self) -> Vec<&'static Library> {
        self.output.file().map_or_else(Vec::new, output::File::libraries)
    }

    fn revisions(&self) -> BTreeMap<String, u32> {
        self.output.file().map_or_else(BTreeMap::new, output::File::revisions)
    }
}

impl Model for External {
    fn signature(&self, context: &Context<'_>) -> Signature {
        given::signature(context, &self.units)
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        given::sound(call)?;
        let folder = Folder::of(call)?;
        let result = self.attempts(call, folder.path());
        let keep = match self.keep {
            Keep::All => true,
            Keep::Failed => result.is_err(),
            Keep::None => false,
        };
        folder.leave(keep);
        result
    }

    fn files(&self, directory: &Path) -> Vec<PathBuf> {
        let templates = self.templates.iter().map(|template| &template.from);
        let named = templates.chain(&self.copy).chain(&self.link).map(|path| directory.join(path));
        // A script of the user's own stands among the words.
        let words = self.command.iter().filter_map(|word| {
            let word = word.fill(|name| run::of_the_study(name, directory)).ok()?;
            let path = directory.join(&word);
            (Path::new(&word).components().count() > 1 && path.is_file()).then_some(path)
        });
        named.chain(words).collect()
    }
}

impl External {
    /// Tries until an attempt goes well or none is left.
    fn attempts(&self, call: &Call<'_>, folder: &Path) -> Result<Response, EvalError> {
        let most = self.retries + 1;
        let mut attempt = 1;
        loop {
            let place = match most {
                1 => folder.to_owned(),
                _ => folder.join(format!("attempt{attempt}")),
            };
            match self.attempt(call, &place) {
                Ok(values) => {
                    let facts = match most {
                        1 => Vec::new(),
                        _ => vec![Fact::new("attempts", attempt)],
                    };
                    return given::response(values, call.layout, facts);
                }
                Err(EvalError::Rejected(_)) if attempt < most => attempt += 1,
                Err(EvalError::Rejected(reason)) if most > 1 => {
                    let reason = format!("{reason} (the last of {most} attempts)");
                    return Err(EvalError::Rejected(reason));
                }
                Err(error) => return Err(error),
            }
        }
    }
}

lacuna::register!(Model, "external", External, aliases: ["command", "executable", "subprocess"]);

#[cfg(all(test, unix))]
mod tests;
