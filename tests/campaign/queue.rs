//! `hyperqueue` tested with the server of the Python package `hyperqueue`, whose client replaces the command `hq`.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};

use lacuna::plugin::Executor;
use lacuna::plugin::registry::from_text;
use tempfile::TempDir;

use super::{failures, run, study};
use crate::quick;

/// A server with one worker; it ends when its input is closed.
pub struct Server {
    folder: TempDir,
    python: PathBuf,
    process: Child,
    input: Option<ChildStdin>,
}

fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("hyperqueue")
}

/// Starts a server if the package is installed; `LACUNA_REQUIRE_PYTHON=1` makes its absence a failure.
pub fn started() -> Option<Server> {
    let python = std::env::var_os("LACUNA_PYTHON").unwrap_or_else(|| "python3".into());
    // The folder `hyperqueue` beside this file counts as an empty package of that name, so an attribute is imported.
    let there = Command::new(&python).args(["-c", "from hyperqueue import Client"]).output();
    let there = there.is_ok_and(|output| output.status.success());
    let required = std::env::var_os("LACUNA_REQUIRE_PYTHON").is_some_and(|value| value == "1");
    assert!(there || !required, "LACUNA_REQUIRE_PYTHON is set, and there is no `hyperqueue`");
    if !there {
        println!("skipped: Python has no package `hyperqueue`");
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut process = Command::new(&python)
        .arg(scripts().join("server.py"))
        .args([folder.path().to_str().unwrap(), "2"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let lines = BufReader::new(process.stdout.take().unwrap()).lines();
    assert!(lines.map_while(Result::ok).any(|line| line == "ready"), "the server does not start");
    let input = process.stdin.take();
    Some(Server { folder, python: python.into(), process, input })
}

impl Server {
    /// Folder of the server, into which the command `hq` is written.
    pub fn folder(&self) -> &Path {
        let command = self.folder.path().join("hq");
        let text = format!(
            "#!/bin/sh\nexec '{}' '{}' \"$@\"\n",
            self.python.display(),
            scripts().join("hq.py").display()
        );
        fs::write(&command, text).unwrap();
        let executable = Command::new("chmod").arg("+x").arg(&command).status().unwrap();
        assert!(executable.success());
        self.folder.path()
    }

    /// Options that name the command and the server.
    fn options(&self) -> String {
        self.inline().replace(", ", "\n") + "\n"
    }

    /// These options in the braces of an inline table.
    pub fn inline(&self) -> String {
        let folder = self.folder();
        format!(
            "command = \"{}\", server = \"{}\", poll = 1, patience = 1",
            folder.join("hq").display(),
            folder.display()
        )
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.input = None;
        let _ = self.process.wait();
    }
}

#[test]
fn hyperqueue_keeps_the_contract_of_executors() {
    let Some(server) = started() else { return };
    let worker = env!("CARGO_BIN_EXE_contract_worker");
    let options = format!("{}pack = 2\nprogram = \"{worker}\"\n", server.options());
    let built = from_text::<dyn Executor>("hyperqueue", &options).unwrap();
    let scratch = tempfile::tempdir().unwrap();
    let kept = lacuna_contract::executor("hyperqueue", &*built.plugin, scratch.path());
    assert_eq!(kept, Ok(()));
}

#[test]
fn a_queue_makes_the_runs_and_tells_why_some_have_none() {
    let Some(server) = started() else { return };
    let script = "case $1 in run002) exit 7;; run003) kill -9 $PPID;; esac; echo \"[$2]\"";
    let executor = format!("use = \"hyperqueue\"\n{}", server.options());
    let (folder, path) = study(script, &executor);
    let out = folder.path().join("run");
    let (code, text) = quick::said(&mut run(&path, &out, &[]));
    assert_eq!(code, Some(1), "{text}");
    let failed = failures(&out);
    let names: Vec<&str> = failed.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["run002", "run003"], "{failed:?}");
    assert!(failed[0].1.contains("exit code 7"), "{failed:?}");
    assert!(failed[1].1.contains("Program terminated with exit code 137"), "{failed:?}");
}
