//! The program that makes runs in another process.

use std::path::{Path, PathBuf};

use lacuna::run::Stop;
use lacuna::study::problem::Complaints;

use crate::models::process;

/// The file that `program` means: a path from the study's folder, a name that is looked up in `PATH`, or, when it is
/// left out, the program that runs now.
pub fn program(given: Option<&Path>, study: &Path) -> Result<PathBuf, Stop> {
    let Some(given) = given else {
        return std::env::current_exe()
            .map_err(|error| Stop::new(format!("the running program cannot be found: {error}")));
    };
    let found = given.to_str().and_then(|text| process::find(text, study, None));
    found.ok_or_else(|| {
        Stop::new(format!("there is no program `{}`", given.display()))
            .help("let `program` in `[executor]` name `lacuna` as the machines of the runs find it")
    })
}

/// The same for other machines: they may have a path from the root that this one has not.
pub fn on_nodes(given: Option<&Path>, study: &Path) -> Result<PathBuf, Stop> {
    match given {
        Some(path) if path.is_absolute() => Ok(path.to_owned()),
        _ => program(given, study),
    }
}

/// Complains of a program that is not there.
pub fn check(found: Result<PathBuf, Stop>, complaints: &mut Complaints<'_>) {
    if let Err(stop) = found {
        complaints
            .at("program")
            .say(stop.message)
            .expected("the `lacuna` program: a path from the study's folder, or a name in PATH");
    }
}
