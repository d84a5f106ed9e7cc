//! Errors in a Python file that can be found without running it: by an interpreter that parses it, or by its text
//! alone where no program may be started.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use lacuna::plugin::Context;
use lacuna::text::nearest::nearest;
use lacuna::text::problem::Complaints;
use lacuna_run::process::interpreter;
use serde::Deserialize;

use super::{Python, written};
use crate::models::given;

const SCRIPT: &str = include_str!("names.py");
/// Arguments that a function may have in addition to the inputs.
const EXTRA: [&str; 2] = ["layout", "scenario"];

/// Definitions in a file.
#[derive(Deserialize)]
#[serde(untagged)]
pub enum Names {
    /// The file cannot be parsed.
    Wrong {
        /// Description of the error.
        error: String,
        /// Line of the error.
        line: Option<usize>,
    },
    /// The file can be parsed.
    Sound {
        /// The requested functions, with their arguments where these can be determined.
        functions: BTreeMap<String, Option<Arguments>>,
        /// The requested functions that the file does not define.
        unknown: Vec<String>,
        /// All functions of the file.
        defined: Vec<String>,
    },
}

/// Arguments of a function that can be passed by name.
#[derive(Deserialize)]
pub struct Arguments {
    /// Names of the arguments.
    pub names: Vec<String>,
    /// Names of the arguments that have a default.
    pub optional: Vec<String>,
    /// The function accepts any other name too (`**kwargs`).
    pub any: bool,
}

/// Checks the options against the files and programs of the machine.
pub fn files(model: &Python, context: &Context<'_>, complaints: &mut Complaints<'_>) {
    let file = context.directory.join(&model.file);
    if !file.is_file() {
        complaints.at("file").say(format!("there is no file `{}`", file.display()));
    }
    let Some(python) = interpreter(&model.interpreter, context.directory) else {
        let name = model.interpreter.display();
        complaints
            .at("interpreter")
            .say(format!("there is no file `{name}`: the Python interpreter is not there"))
            .help("name a program in `PATH`, its path, or the folder of a virtual environment");
        return;
    };
    if file.is_file() {
        names(model, &python, &file, context, complaints);
    }
}

/// Definitions that an interpreter finds in the file; `None` if it does not answer.
fn read(python: &Path, file: &Path, wanted: &[&str]) -> Option<Names> {
    let output = Command::new(python)
        .args(["-c", SCRIPT])
        .arg(file)
        .args(wanted)
        .stdin(Stdio::null())
        .output();
    let found = output.ok().filter(|output| output.status.success())?;
    serde_json::from_slice::<Names>(&found.stdout).ok()
}

fn names(
    model: &Python,
    python: &Path,
    file: &Path,
    context: &Context<'_>,
    complaints: &mut Complaints<'_>,
) {
    let wanted = [("function", Some(&model.function)), ("gradient", model.gradient.as_ref())];
    let wanted: Vec<_> = wanted.into_iter().filter_map(|(key, name)| Some(key).zip(name)).collect();
    let asked: Vec<&str> = wanted.iter().map(|(_, name)| name.as_str()).collect();
    let found = if context.starts_programs {
        read(python, file, &asked)
    } else {
        std::fs::read_to_string(file).ok().map(|text| written::names(&text, &asked))
    };
    let Some(found) = found else {
        if !context.starts_programs {
            complaints.at("file").say(format!("{} is not text in UTF-8", file.display()));
            return;
        }
        let name = model.interpreter.display();
        complaints
            .at("interpreter")
            .say(format!("`{name}` is not a working Python interpreter of version 3.8 or later"));
        return;
    };
    match found {
        Names::Wrong { error, line } => {
            let line = line.map_or(String::new(), |line| format!(":{line}"));
            complaints.at("file").say(format!("{}{line}: {error}", file.display()));
        }
        Names::Sound { functions, unknown, defined } => {
            for (key, name) in wanted {
                if unknown.contains(name) {
                    let names = || defined.iter().map(String::as_str);
                    let text = format!("{} has no function `{name}`", model.file.display());
                    let problem = complaints.at(key).say(text);
                    if !defined.is_empty() {
                        problem.expected(given::listed(names()));
                    }
                    if let Some(near) = nearest(name, names()) {
                        problem.help(format!("did you mean `{near}`?"));
                    }
                } else if let Some(Some(arguments)) = functions.get(name) {
                    arguments.check(key, name, context, complaints);
                }
            }
        }
    }
}

/// Argument that an input is passed with: its name; the values of a field, `name[1]` and so on, are one argument.
fn argument(input: &str) -> &str {
    input.split_once('[').map_or(input, |(base, _)| base)
}

impl Arguments {
    /// Complains of inputs that the function does not accept and of arguments that have no value.
    fn check(&self, key: &str, name: &str, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let mut arguments: Vec<&str> =
            context.given.iter().map(|given| argument(&given.name)).collect();
        arguments.dedup();
        let inputs = || arguments.iter().copied();
        for input in inputs().filter(|input| !self.any && !self.takes(input)) {
            let free = || self.names.iter().map(String::as_str);
            let problem =
                complaints.at(key).say(format!("`{name}` has no argument for the input `{input}`"));
            if let Some(near) = nearest(input, free()) {
                problem.help(format!("did you mean `{near}`?"));
            }
        }
        let given =
            |argument: &str| EXTRA.contains(&argument) || inputs().any(|input| input == argument);
        let wanted = self.names.iter().filter(|a| !given(a) && !self.optional.contains(a));
        for argument in wanted {
            complaints
                .at(key)
                .say(format!("`{name}` requires the argument `{argument}`, which is not an input of the study"))
                .expected(given::listed(inputs()));
        }
    }

    fn takes(&self, input: &str) -> bool {
        self.names.iter().any(|argument| argument == input)
    }
}
