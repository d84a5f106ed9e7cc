//! Commands of the scheduler.

use std::process::{Command, Stdio};

use lacuna::run::{Stop, files};

/// What a command prints; an error with its own words when it fails.
pub fn said(program: &str, arguments: &[&str]) -> Result<String, Stop> {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null());
    // Formats of the user's own would change the columns.
    for variable in
        ["SQUEUE_FORMAT", "SQUEUE_FORMAT2", "SACCT_FORMAT", "SQUEUE_STATES", "SLURM_TIME_FORMAT"]
    {
        command.env_remove(variable);
    }
    let shown = || format!("{program} {}", arguments.join(" "));
    let output = command.output().map_err(|error| {
        Stop::new(format!("cannot run `{}`: {}", shown(), files::in_words(&error)))
    })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let words = String::from_utf8_lossy(&output.stderr);
    let code = output.status.code().map_or(String::new(), |code| format!(" (exit code {code})"));
    Err(Stop::new(format!("`{}` failed{code}: {}", shown(), words.trim())))
}
