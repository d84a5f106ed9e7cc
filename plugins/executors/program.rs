//! The `lacuna` program that makes runs in another process.

use std::path::{Path, PathBuf};

use lacuna::run::Stop;
use lacuna::text::problem::Complaints;

use lacuna_run::process;

/// Environment variable with the path of the command, if the running program is another: a Python interpreter.
const COMMAND: &str = "LACUNA_PROGRAM";

/// Resolves `program`: a path relative to the study's folder, a name in `PATH`, or, if it is not given, the running
/// program.
pub fn program(given: Option<&Path>, study: &Path) -> Result<PathBuf, Stop> {
    let Some(given) = given else {
        if let Some(command) = std::env::var_os(COMMAND) {
            return Ok(command.into());
        }
        return std::env::current_exe()
            .map_err(|error| Stop::new(format!("the running program cannot be found: {error}")));
    };
    let found = given.to_str().and_then(|text| process::find(text, study, None));
    found.ok_or_else(|| {
        Stop::new(format!("there is no program `{}`", given.display()))
            .help("let `program` in `[executor]` name `lacuna` as the machines of the runs find it")
    })
}

/// Like [`program`], for other machines: an absolute path is accepted as it is, because it may exist only there.
pub fn on_nodes(given: Option<&Path>, study: &Path) -> Result<PathBuf, Stop> {
    match given {
        Some(path) if path.is_absolute() => Ok(path.to_owned()),
        _ => program(given, study),
    }
}

/// Reports a program that does not exist.
pub fn check(found: Result<PathBuf, Stop>, complaints: &mut Complaints<'_>) {
    if let Err(stop) = found {
        complaints
            .at("program")
            .say(stop.message)
            .expected("the `lacuna` program: a path from the study's folder, or a name in PATH");
    }
}
