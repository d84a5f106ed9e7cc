//! Shell script of a task: the user's lines, `lacuna work`, and the exit code written to disk in every case.

use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};

use super::Plan;
use crate::executors::program;

/// The scheduler's own part of a script.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// File name of the script.
    pub file: &'static str,
    /// Directives for the scheduler, after the first line.
    pub directives: Vec<String>,
    /// Environment variable with the index of the task.
    pub task: &'static str,
    /// True if the script itself redirects its output to `taskN.txt`.
    pub log: bool,
}

/// Settings of the program that makes the runs of a task.
#[derive(Debug, Clone, Copy)]
pub struct Worker<'a> {
    /// Environment modules, loaded first.
    pub modules: &'a [String],
    /// Shell lines after the modules.
    pub setup: &'a [String],
    /// Program as given in the study.
    pub program: Option<&'a Path>,
    /// Number of runs of the task made at a time.
    pub parallel: usize,
}

/// Writes the script of a submission into its folder and returns its path; fails if a path cannot be written in a
/// script.
pub fn write(frame: &Frame, worker: &Worker<'_>, plan: &Plan<'_>) -> Result<PathBuf, Stop> {
    for (what, path) in [("run directory", plan.folder), ("study", plan.study)] {
        if path.to_str().is_none_or(|text| text.contains(['\n', '\r'])) {
            let path = path.to_string_lossy().replace(['\n', '\r'], "\u{23ce}");
            return Err(Stop::new(format!(
                "a job script cannot contain the path of the {what}: {path}"
            ))
            .help("move it to a path in UTF-8 without line breaks"));
        }
    }
    let program = program::on_nodes(worker.program, plan.study)?;
    let path = plan.folder.join(frame.file);
    files::write_atomic(&path, text(frame, worker, &program, plan.folder).as_bytes())?;
    Ok(path)
}

/// Beginning of every script. The exit code is written under another name and renamed, so that an existing file is
/// complete. The trap for TERM is needed because a shell that is terminated would otherwise record the exit code 0.
const HEAD: &str = r#"
note() {
    printf '%s\n' "$1" > "$folder/task$task.exit.part" &&
        mv "$folder/task$task.exit.part" "$folder/task$task.exit"
}
trap 'note $?' EXIT
trap 'exit 143' TERM
check() {
    if [ "$1" -ne 0 ]; then
        echo "$2 ended with exit code $1 on $(uname -n)" >&2
        exit "$1"
    fi
}
"#;

fn text(frame: &Frame, worker: &Worker<'_>, program: &Path, folder: &Path) -> String {
    let mut text = String::from("#!/bin/bash\n");
    for line in &frame.directives {
        text.push_str(&format!("{line}\n"));
    }
    text.push_str(&format!("\nfolder={}\ntask=${{{}}}\n", quoted(folder), frame.task));
    if frame.log {
        text.push_str("exec > \"$folder/task$task.txt\" 2>&1\n");
    }
    text.push_str(HEAD);
    let modules = worker.modules.iter().map(|name| (format!("module load {name}"), "modules"));
    let setup = worker.setup.iter().map(|line| (line.clone(), "setup"));
    for (line, key) in modules.chain(setup) {
        // A failing line ends the job: runs without the preparation before them would be wrong, or fail one by one.
        let named = word(&format!("`{}` of `{key}`", line.trim()));
        text.push_str(&format!("{line}\ncheck $? {named}\n"));
    }
    let (program, parallel) = (quoted(program), worker.parallel);
    text.push_str(&format!(
        "program={program}\n\
         if [ ! -x \"$program\" ]; then\n    \
             echo \"there is no program \\`$program\\` on $(uname -n)\" >&2\n    \
             exit 127\n\
         fi\n\
         \"$program\" work \"$folder\" --task \"$task\" --parallel {parallel}\n"
    ));
    text
}

/// Reads the exit code that a task left behind.
pub fn exit_code(folder: &Path, task: usize) -> Option<i32> {
    let text = std::fs::read_to_string(folder.join(format!("task{task}.exit"))).ok()?;
    text.trim().parse().ok()
}

/// Quotes a path as one shell word.
pub fn quoted(path: &Path) -> String {
    word(&path.display().to_string())
}

/// Quotes a text as one shell word.
pub fn word(text: &str) -> String {
    format!("'{}'", text.replace('\'', "'\\''"))
}

#[cfg(all(test, unix))]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::fs;
    use std::process::Command;

    use super::*;

    /// Runs a script with these lines of setup; returns its output and the recorded exit code.
    fn ran(program: &str, setup: &[&str]) -> (String, i32) {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("it's 100% \"fine\"");
        fs::create_dir(&place).unwrap();
        let setup: Vec<String> = setup.iter().map(ToString::to_string).collect();
        let given = Path::new(program);
        let worker = Worker { modules: &[], setup: &setup, program: Some(given), parallel: 1 };
        let frame = Frame { file: "task.sh", directives: Vec::new(), task: "TASK", log: true };
        let plan = Plan {
            folder: &place,
            study: folder.path(),
            name: "x",
            tasks: 1,
            time: 1.0,
            memory: 1.0,
        };
        let script = write(&frame, &worker, &plan).unwrap();
        Command::new("bash").arg(&script).env("TASK", "3").status().unwrap();
        let said = fs::read_to_string(place.join("task3.txt")).unwrap();
        (said, exit_code(&place, 3).unwrap())
    }

    #[test]
    fn a_line_of_setup_that_fails_ends_the_job() {
        let (said, code) = ran("/bin/echo", &["export A='a b'", "test \"$A\" = 'a b'"]);
        assert!(said.starts_with("work ") && said.contains("100% \"fine\" --task 3"), "{said}");
        assert_eq!(code, 0);
        let (said, code) = ran("/bin/echo", &["source \"/nowhere/it's.sh\" 2>/dev/null"]);
        assert_eq!(code, 1);
        assert!(!said.contains("work "), "{said}");
        assert!(
            said.contains("`source \"/nowhere/it's.sh\" 2>/dev/null` of `setup` ended"),
            "{said}"
        );
        assert_eq!(ran("/bin/echo", &["false || true"]).1, 0);
        assert_eq!(ran("/bin/echo", &["if true\nthen exit 9\nfi"]).1, 9);
    }

    #[test]
    fn a_program_that_is_not_there_is_named() {
        let (said, code) = ran("/nowhere/lacuna", &[]);
        assert_eq!(code, 127);
        assert!(said.contains("there is no program `/nowhere/lacuna` on "), "{said}");
    }

    #[test]
    fn a_script_that_is_told_to_end_does_not_call_it_a_success() {
        assert_eq!(ran("/bin/echo", &["kill -TERM $$"]).1, 143);
    }

    #[test]
    fn a_path_that_no_script_can_have_is_refused() {
        let worker = Worker { modules: &[], setup: &[], program: None, parallel: 1 };
        let frame = Frame { file: "task.sh", directives: Vec::new(), task: "TASK", log: true };
        let (folder, study) = (Path::new("/a\nb"), Path::new("/study"));
        let plan = Plan { folder, study, name: "x", tasks: 1, time: 1.0, memory: 1.0 };
        let stop = write(&frame, &worker, &plan).unwrap_err();
        assert!(stop.message.contains("the path of the run directory: /a"), "{stop}");
    }
}
