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
use lacuna::plugin::model::{Call, EvalError, Response, Signature};
use lacuna::plugin::{Component, Context, Fact, Library, Model};
use lacuna::run::Fault;
use lacuna::text::problem::Complaints;
use lacuna::text::values::Positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::folder::Folder;
use super::given;

pub use self::output::Output;
pub use self::template::Template;

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
/// Every run has a folder of its own, in which the command is started; its output is kept there in `stdout.txt` and
/// `stderr.txt`. The inputs are all that the study gives (parameters, fixed values, values of a scenario), in the
/// study's units or in those of `units`. They reach the command through **templates**, in which `{{ density }}` is
/// replaced by a value and `{{ density | %.6e }}` by the value in a format of C's `printf` (flags, width and
/// precision with `e`, `f`, `g`, `E`, `G`); without a format it is the shortest text that reads back as the same
/// number. `{{ run }}` is the name of the run, `{{ scenario }}` that of the scenario, `{{ study }}` the folder of the
/// study. The words of `command` and the values of `environment` are templates too. Alternatively the inputs are
/// passed as **JSON** on standard input:
/// `{"run": …, "inputs": {name: value}, "scenario": {"name": …, "values": {…}, "functions": {…}}, "layout": {"name": …, "unit": …, "axes": […]}}`.
///
/// A run that fails (exit code, `success`, `timeout`, output that is missing, damaged or not finite) is repeated up
/// to `retries` times, then counts as failed with its reason; the study continues. When a run has ended, for whatever
/// reason, all processes that it started are terminated.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct External {
    /// Program and its arguments, one word per element. A program with a `/` is relative to the study file, any other
    /// is looked up in `PATH`. No shell is involved unless it is named: `["sh", "-c", "…"]`.
    pub command: Vec<Template>,
    /// Location of the response: `"json"`, or a table with a reader and the file: `use`, `path` relative to the run's
    /// folder, and the reader's options. JSON must be printed to standard output as the only or the last line: nested
    /// lists in the order of the axes, one flat list, or objects by label.
    pub output: Output,
    /// Files made from templates: a list of `{ from = "deck.template", to = "deck.i" }`, the first relative to the
    /// study file, the second to the run's folder.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub templates: Vec<TemplateFile>,
    /// Standard input of the command.
    #[serde(default)]
    pub input: Input,
    /// Files and folders to be copied into each run's folder, relative to the study file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub copy: Vec<PathBuf>,
    /// Files and folders to which each run's folder gets a link, such as a large mesh, relative to the study file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub link: Vec<PathBuf>,
    /// Environment variables of the command, in addition to those with which Lacuna was started.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub environment: BTreeMap<String, Template>,
    /// Units in which the command expects inputs, if they differ from the study's.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, Unit>,
    /// Time limit of an attempt in seconds; an attempt that exceeds it is stopped and counts as failed. Default: no
    /// limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeout: Option<Positive>,
    /// Largest size of what an attempt may print (`stdout.txt` and `stderr.txt` together), in MB; an attempt that prints
    /// more is stopped and counts as failed.
    #[serde(default = "usual_printed")]
    pub max_printed: Positive,
    /// Conditions for a successful attempt.
    #[serde(default)]
    pub success: Success,
    /// Number of further attempts after a failure. With retries the attempts have folders `attempt1`, `attempt2`, …
    /// in the run's folder.
    #[serde(default)]
    pub retries: usize,
    /// Folders of runs that are kept after the run.
    #[serde(default)]
    pub keep: Keep,
}

/// Default of `max_printed`, in MB.
fn usual_printed() -> Positive {
    Positive::new(100.0).unwrap_or_else(|_| unreachable!("100 is positive"))
}

/// A file made for each run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TemplateFile {
    /// Template, relative to the study file.
    pub from: PathBuf,
    /// Resulting file, relative to the run's folder.
    pub to: PathBuf,
}

/// Standard input of a command.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Input {
    /// Empty.
    #[default]
    None,
    /// One JSON object with the inputs by name.
    Json,
}

/// Conditions for a successful attempt.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Success {
    /// Exit codes of a successful run.
    pub exit_codes: Vec<i32>,
    /// File that shows success, relative to the run's folder.
    pub file: PathBuf,
    /// Texts that this file must all contain.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contains: Vec<String>,
    /// Texts of which this file must contain none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lacks: Vec<String>,
}

impl Default for Success {
    fn default() -> Self {
        let file = PathBuf::from(run::STDOUT);
        Self { exit_codes: vec![0], file, contains: Vec::new(), lacks: Vec::new() }
    }
}

/// Folders of runs that are kept after the run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// Keep the folders of all runs.
    #[default]
    All,
    /// Keep the folders of failed runs only.
    Failed,
    /// Keep no folder.
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
        // A script of the user's own may be among the words.
        let words = self.command.iter().filter_map(|word| {
            let word = word.fill(|name| run::of_the_study(name, directory)).ok()?;
            let path = directory.join(&word);
            (Path::new(&word).components().count() > 1 && path.is_file()).then_some(path)
        });
        named.chain(words).collect()
    }
}

impl External {
    /// Repeats attempts until one succeeds or none is left.
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
