//! Follows the READMEs of examples and guides as a newcomer would: in a copy of the folder, command by command.
//!
//! A block `sh` is executed line by line. A block `text` after it is the expected output of its last command, with `…`
//! for anything that differs from machine to machine; if it begins with `error` the command must end with code 1, which
//! no other command may.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use tempfile::TempDir;

use crate::docs::markdown::Page;
use crate::quick;

/// Folders of the project, copied to a place outside it, and the page that is followed there.
pub struct Walk {
    copy: TempDir,
    page: PathBuf,
    /// Folder in which the commands are given, relative to the copy.
    place: PathBuf,
    /// Folders that are searched for programs before those of `PATH`.
    pub programs: Vec<PathBuf>,
    pub variables: Vec<(&'static str, OsString)>,
    /// Programs that the page leaves running.
    started: Vec<Child>,
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name())).unwrap();
        // Leftovers of somebody's own run of the example.
        if ["runs", "__pycache__"].iter().any(|own| name == *own) {
            continue;
        }
        if path.is_dir() {
            copy(&path, &to.join(name));
        } else {
            fs::copy(&path, to.join(name)).unwrap();
        }
    }
}

impl Walk {
    /// Copies folders; the first contains the page, `place` is the folder in which its commands are given. Programs are
    /// those of the tests.
    pub fn begin(folders: &[&str], place: &str) -> Self {
        let to = tempfile::tempdir().unwrap();
        for folder in folders {
            copy(&quick::root().join(folder), &to.path().join(folder));
        }
        let page = to.path().join(folders[0]).join("README.md");
        Self::at(to, page, place)
    }

    /// Follows a guide in an empty folder; its path is relative to the root of the project.
    pub fn guide(page: &str) -> Self {
        Self::at(tempfile::tempdir().unwrap(), quick::root().join(page), "")
    }

    fn at(copy: TempDir, page: PathBuf, place: &str) -> Self {
        let lacuna = PathBuf::from(quick::command().get_program());
        let mut programs = vec![lacuna.parent().unwrap().to_owned()];
        if let Some(python) = std::env::var_os("LACUNA_PYTHON") {
            programs.push(Path::new(&python).parent().unwrap().to_owned());
        }
        let (variables, started) = (Vec::new(), Vec::new());
        Self { copy, page, place: place.into(), programs, variables, started }
    }

    /// A path as the commands see it.
    pub fn path(&self, path: &str) -> PathBuf {
        self.copy.path().join(&self.place).join(path)
    }

    fn command(&self, line: &str) -> Command {
        let old = std::env::var_os("PATH").unwrap_or_default();
        let folders = self.programs.iter().cloned().chain(std::env::split_paths(&old));
        let mut command = Command::new("sh");
        command.args(["-c", line]).current_dir(self.path(""));
        command.env("PATH", std::env::join_paths(folders).unwrap()).stdin(Stdio::null());
        command.envs(self.variables.iter().map(|(name, value)| (name, value)));
        command
    }

    /// Runs a command that must end with this code, and returns its output.
    pub fn give(&mut self, line: &str, code: i32) -> String {
        if let Some(line) = line.strip_suffix(" &") {
            let mut command = self.command(&format!("exec {line}"));
            self.started.push(command.stdout(Stdio::null()).spawn().unwrap());
            return String::new();
        }
        let output = self.command(&format!("{{ {line}\n}} 2>&1")).output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        assert_eq!(output.status.code(), Some(code), "{line}\n{text}");
        text
    }

    /// Ends one of the programs that were left running, counted from 0.
    pub fn end(&mut self, number: usize) {
        self.started[number].kill().unwrap();
        self.started[number].wait().unwrap();
    }

    /// Follows the part of the page below a heading.
    pub fn follow(&mut self, heading: &str) {
        let part = Page::read(&self.page).section(heading);
        let (commands, texts) = (part.blocks("sh"), part.blocks("text"));
        assert!(!commands.is_empty(), "nothing is done below `{heading}`");
        for (i, block) in commands.iter().enumerate() {
            let next = commands.get(i + 1).map_or(usize::MAX, |block| block.line);
            let shown = texts.iter().find(|text| (block.line..next).contains(&text.line));
            let shown = shown.map_or("", |text| text.text.as_str());
            let fails = shown.starts_with("error");
            let lines: Vec<&str> = block.text.lines().collect();
            let mut said = String::new();
            for (k, line) in lines.iter().enumerate() {
                said = self.give(line, i32::from(fails && k + 1 == lines.len()));
            }
            for wanted in shown.lines() {
                let there = said.lines().any(|line| like(line.trim_end(), wanted.trim_end()));
                assert!(there, "{}\nprints no line `{wanted}`, but\n{said}", block.text);
            }
        }
    }
}

/// Returns true if two lines are equal except for the text that `…` replaces.
fn like(line: &str, wanted: &str) -> bool {
    let Some((first, rest)) = wanted.split_once('…') else { return line == wanted };
    let Some(after) = line.strip_prefix(first) else { return false };
    (0..=after.len()).any(|i| after.get(i..).is_some_and(|after| like(after, rest)))
}

impl Drop for Walk {
    fn drop(&mut self) {
        for child in &mut self.started {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

#[test]
fn a_line_is_like_another_where_it_may_be_anything() {
    let line = "  run007     failed  0.1 s  exit code 3";
    for wanted in [line, "  run007     failed … s  exit code 3", "  run007…", "…3", "…"] {
        assert!(like(line, wanted), "{wanted}");
    }
    for wanted in ["  run007", "run007…", "  run007     failed … s", "…s … s …"] {
        assert!(!like(line, wanted), "{wanted}");
    }
}
