//! Commands of the scheduler.

use std::process::{Command, ExitStatus, Stdio};

use lacuna::run::{Stop, files};

/// Runs a command and returns its standard output; if it fails, the error contains its standard error.
pub fn said(program: &str, arguments: &[&str]) -> Result<String, Stop> {
    said_without(program, arguments, |_| false)
}

/// Like [`said`], with some variables removed from the environment of the command.
pub fn said_without(
    program: &str,
    arguments: &[&str],
    is_hidden: impl Fn(&str) -> bool,
) -> Result<String, Stop> {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null());
    // The user's own formats and filters would change the output.
    let changes_answers = |name: &str| {
        ["SQUEUE_", "SACCT_", "SCANCEL_"].iter().any(|start| name.starts_with(start))
            || name == "SLURM_TIME_FORMAT"
    };
    for (name, _) in std::env::vars_os() {
        if name.to_str().is_some_and(|name| changes_answers(name) || is_hidden(name)) {
            command.env_remove(name);
        }
    }
    let shown = || format!("{program} {}", arguments.join(" "));
    let output = command.output().map_err(|error| {
        Stop::new(format!("cannot run `{}`: {}", shown(), files::in_words(&error)))
    })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let words = String::from_utf8_lossy(&output.stderr);
    Err(Stop::new(format!("`{}` failed{}: {}", shown(), ending(output.status), words.trim())))
}

fn ending(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return format!(" (ended by signal {signal})");
    }
    status.code().map_or(String::new(), |code| format!(" (exit code {code})"))
}
