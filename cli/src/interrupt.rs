//! Ctrl-C in a command that computes: what is kept, and how to go on. The process then ends as the signal ends it.

use std::io;
use std::path::Path;
#[cfg(unix)]
use std::thread;

use crate::terminal::tell;

/// How an interrupted command goes on.
#[derive(Debug, Clone, Copy)]
pub enum Next {
    /// By `lacuna resume` with the run directory.
    Resume,
    /// By the same command.
    Again,
}

/// The line for a run directory; nothing is kept before it holds a study.
fn line(folder: &Path, next: Next) -> String {
    let begun = folder.join("resolved.toml").exists();
    let folder = folder.display();
    match next {
        Next::Resume if begun => format!(
            "interrupted: finished stages, runs and steps are kept; `lacuna resume {folder}` goes on"
        ),
        _ => format!(
            "interrupted: what is finished is kept in {folder}; the same command goes on from there"
        ),
    }
}

/// Says so when the process is asked to end, by Ctrl-C or by a scheduler, and ends it as the signal does without a handler.
///
/// Where signals cannot be waited for, the process ends without a word.
pub fn explain(folder: &Path, next: Next) {
    let folder = folder.to_owned();
    let _ = when_asked(move |signal| {
        tell(&format!("\n{}", line(&folder, next)));
        end(signal);
    });
}

/// Calls a function with the number of the signal each time the process is asked to end.
#[cfg(unix)]
pub fn when_asked(act: impl Fn(i32) + Send + 'static) -> io::Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM};

    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
    thread::spawn(move || signals.forever().for_each(act));
    Ok(())
}

/// The process ends with the status by which a shell knows the signal.
#[cfg(unix)]
fn end(signal: i32) {
    let _ = signal_hook::low_level::emulate_default_handler(signal);
}

/// Without signals of Unix the process just ends.
#[cfg(not(unix))]
pub fn when_asked(_: impl Fn(i32) + Send + 'static) -> io::Result<()> {
    Ok(())
}

#[cfg(not(unix))]
fn end(_: i32) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_without_a_study_is_not_resumed() {
        let folder = tempfile::tempdir().unwrap();
        assert!(line(folder.path(), Next::Resume).contains("the same command"));
        std::fs::write(folder.path().join("resolved.toml"), "").unwrap();
        let resumed = format!("`lacuna resume {}`", folder.path().display());
        assert!(line(folder.path(), Next::Resume).contains(&resumed));
        assert!(line(folder.path(), Next::Again).contains("the same command"));
    }
}
