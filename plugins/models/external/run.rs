//! Execution of one attempt at a run.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};

use lacuna::plugin::model::{Call, EvalError};
use lacuna::run::files::in_words;
use lacuna::text::values::Positive;
use serde_json::{Map, Value, json};

use super::folder::{cannot, copy, link};
use super::output::Output;
use super::template::{Filling, Template};
use super::{External, Input, answer, given};
use lacuna_run::process::{self, End, Process, tail_of_file};

/// File with the standard output of the command.
pub const STDOUT: &str = "stdout.txt";
/// File with the standard error of the command.
pub const STDERR: &str = "stderr.txt";
/// File with the standard input of the command.
pub const STDIN: &str = "input.json";
/// Names in templates that are not inputs.
pub const NOT_INPUTS: [&str; 3] = ["run", "scenario", "study"];

/// Returns the value of a name that is the same in all runs.
pub fn of_the_study(name: &str, directory: &Path) -> Option<Filling> {
    let folder = std::path::absolute(directory).unwrap_or_else(|_| directory.to_owned());
    (name == "study").then(|| Filling::Text(folder.display().to_string()))
}

/// Returns the value of a name in a run.
fn value(name: &str, call: &Call<'_>) -> Option<Filling> {
    if let Some(i) = call.names.iter().position(|input| input == name) {
        return Some(Filling::Number(call.inputs[i]));
    }
    match name {
        "run" => Some(Filling::Text(run_name(call).to_owned())),
        "scenario" => Some(Filling::Text(call.scenario.name.clone())),
        _ => of_the_study(name, call.study),
    }
}

/// Returns the name of the run's folder; `run` for an evaluation of which nothing is kept.
fn run_name<'a>(call: &Call<'a>) -> &'a str {
    call.directory.and_then(Path::file_name).and_then(|name| name.to_str()).unwrap_or("run")
}

fn fill(template: &Template, call: &Call<'_>) -> Result<String, EvalError> {
    template
        .fill(|name| value(name, call))
        .map_err(|name| EvalError::Fatal(format!("there is no input `{name}`")))
}

impl External {
    /// Runs the command in a new folder and reads the response.
    pub(super) fn attempt(&self, call: &Call<'_>, folder: &Path) -> Result<Vec<f64>, EvalError> {
        fs::create_dir_all(folder).map_err(|error| cannot("make the folder", folder, &error))?;
        self.provide(call, folder)?;
        let status = self.execute(call, folder)?;
        self.judge(status, call, folder)?;
        self.response(call, folder)
    }

    /// Fills the folder with the files that the command needs.
    fn provide(&self, call: &Call<'_>, folder: &Path) -> Result<(), EvalError> {
        let study = std::path::absolute(call.study).unwrap_or_else(|_| call.study.to_owned());
        for (paths, put) in [(&self.copy, copy as fn(&Path, &Path) -> _), (&self.link, link)] {
            for path in paths {
                let from = study.join(path);
                let to = folder.join(path.file_name().unwrap_or_default());
                put(&from, &to).map_err(|error| cannot("copy", &from, &error))?;
            }
        }
        for template in &self.templates {
            let from = study.join(&template.from);
            let text = fs::read_to_string(&from).map_err(|error| cannot("read", &from, &error))?;
            let parsed = Template::parse(text)
                .map_err(|error| EvalError::Fatal(format!("{}: {error}", from.display())))?;
            write(&folder.join(&template.to), &fill(&parsed, call)?)?;
        }
        match self.input {
            Input::None => Ok(()),
            Input::Json => write(&folder.join(STDIN), &document(call).to_string()),
        }
    }

    /// Runs the command to its end; fails if it exceeds the time limit or the limit of what it may print.
    fn execute(&self, call: &Call<'_>, folder: &Path) -> Result<ExitStatus, EvalError> {
        let words: Vec<String> =
            self.command.iter().map(|word| fill(word, call)).collect::<Result<_, _>>()?;
        let (name, arguments) =
            words.split_first().ok_or_else(|| EvalError::Fatal("`command` is empty".to_owned()))?;
        let variables: Vec<(&String, String)> = self
            .environment
            .iter()
            .map(|(key, text)| Ok((key, fill(text, call)?)))
            .collect::<Result<_, EvalError>>()?;
        let path = variables.iter().find(|(key, _)| *key == "PATH").map(|(_, path)| path.as_ref());
        let program = process::find(name, call.study, path)
            .ok_or_else(|| EvalError::Fatal(format!("there is no program `{name}`")))?;
        let open = |name: &str| {
            let path = folder.join(name);
            File::create(&path).map_err(|error| cannot("write", &path, &error))
        };
        let stdin = match self.input {
            Input::None => Stdio::null(),
            Input::Json => {
                let path = folder.join(STDIN);
                File::open(&path).map_err(|error| cannot("read", &path, &error))?.into()
            }
        };
        let mut command = Command::new(&program);
        command.args(arguments).envs(variables).current_dir(folder);
        command.stdin(stdin).stdout(open(STDOUT)?).stderr(open(STDERR)?);
        let most = (self.max_printed.get() * 1e6) as u64;
        let little = || {
            let size = |file| fs::metadata(folder.join(file)).map_or(0, |found| found.len());
            size(STDOUT) + size(STDERR) <= most
        };
        let limit = self.timeout.map(Positive::seconds);
        let ended =
            Process::start(&mut command).and_then(|mut process| process.wait_while(limit, little));
        match ended.map_err(|error| cannot("run", &program, &error))? {
            End::Itself(status) if little() => Ok(status),
            End::Late => {
                let limit = limit.unwrap_or_default().as_secs_f64();
                Err(rejected(folder, format!("`{name}` was stopped after {limit} s")))
            }
            End::Itself(_) | End::Stopped => {
                let most = self.max_printed.get();
                let text =
                    format!("`{name}` printed more than {most} MB (`max_printed` in `[model]`)");
                Err(rejected(folder, text))
            }
        }
    }

    /// Fails unless the run satisfies the conditions for success.
    fn judge(&self, status: ExitStatus, call: &Call<'_>, folder: &Path) -> Result<(), EvalError> {
        let name = self.name(call);
        match status.code() {
            None => return Err(rejected(folder, format!("`{name}` {}", signalled(status)))),
            Some(code) if !self.success.exit_codes.contains(&code) => {
                return Err(rejected(folder, format!("`{name}` ended with exit code {code}")));
            }
            Some(_) => {}
        }
        let (contains, lacks) = (&self.success.contains, &self.success.lacks);
        if contains.is_empty() && lacks.is_empty() {
            return Ok(());
        }
        let file = self.success.file.display();
        let bytes = fs::read(folder.join(&self.success.file)).map_err(|error| {
            rejected(folder, format!("cannot read `{file}`: {}", in_words(&error)))
        })?;
        let text = String::from_utf8_lossy(&bytes);
        if let Some(missing) = contains.iter().find(|wanted| !text.contains(*wanted)) {
            return Err(rejected(folder, format!("`{file}` does not contain `{missing}`")));
        }
        for unwanted in lacks {
            if let Some(line) = text.lines().find(|line| line.contains(unwanted)) {
                let line = process::tail(line.as_bytes());
                let text = format!("`{file}` contains `{unwanted}`: {line}");
                return Err(EvalError::Rejected(text));
            }
        }
        Ok(())
    }

    fn response(&self, call: &Call<'_>, folder: &Path) -> Result<Vec<f64>, EvalError> {
        match &self.output {
            Output::Json => {
                let bytes = fs::read(folder.join(STDOUT))
                    .map_err(|error| cannot("read", &folder.join(STDOUT), &error))?;
                let values = answer::printed(&String::from_utf8_lossy(&bytes), call.layout);
                values.map_err(|text| rejected(folder, text))
            }
            Output::File(file) => file.read(folder, call.layout).map_err(|error| {
                if error.path.exists() {
                    return EvalError::Rejected(inside(folder, &error.to_string()));
                }
                let (name, path) = (self.name(call), file.path().display());
                rejected(folder, format!("`{name}` wrote no file `{path}`"))
            }),
        }
    }

    /// Returns the program as named in the study, with the placeholders filled in.
    fn name(&self, call: &Call<'_>) -> String {
        self.command.first().and_then(|word| fill(word, call).ok()).unwrap_or_default()
    }
}

fn write(path: &Path, text: &str) -> Result<(), EvalError> {
    let make = || -> std::io::Result<()> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::write(path, text)
    };
    make().map_err(|error| cannot("write", path, &error))
}

/// Returns the inputs as a JSON document.
fn document(call: &Call<'_>) -> Value {
    let pairs = call.names.iter().zip(call.inputs);
    let inputs: Map<String, Value> = pairs.map(|(name, x)| (name.clone(), json!(x))).collect();
    json!({
        "run": run_name(call),
        "inputs": inputs,
        "scenario": given::scenario_document(call.scenario),
        "layout": given::layout_document(call.layout),
    })
}

/// Builds the error of a failed run, with the end of its output.
fn rejected(folder: &Path, reason: String) -> EvalError {
    let printed = [STDERR, STDOUT].map(|file| tail_of_file(&folder.join(file)));
    let tail = printed.into_iter().find(|tail| !tail.is_empty());
    EvalError::Rejected(match tail {
        None => reason,
        Some(tail) => format!("{reason}; it said: {}", inside(folder, &tail)),
    })
}

/// Makes paths inside the run's folder relative to it, because the location of a run is not part of its result.
fn inside(folder: &Path, text: &str) -> String {
    let text = text.replace(&format!("{}/", folder.display()), "");
    text.chars().filter(|c| !c.is_control() || *c == '\n').collect()
}

#[cfg(unix)]
fn signalled(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt as _;
    status.signal().map_or("ended".to_owned(), |signal| format!("was ended by signal {signal}"))
}

#[cfg(not(unix))]
fn signalled(_: ExitStatus) -> String {
    "ended without an exit code".to_owned()
}
