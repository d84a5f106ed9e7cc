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

/// Complains of a program that is not there.
pub fn check(given: Option<&Path>, study: &Path, complaints: &mut Complaints<'_>) {
    if let Err(stop) = program(given, study) {
        complaints
            .at("program")
            .say(stop.message)
            .expected("the `lacuna` program: a path from the study's folder, or a name in PATH");
    }
}
