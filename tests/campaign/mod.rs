//! Ensembles made by other processes, on this machine and on a cluster.

mod example;
mod import;
mod jobs;
mod moved;
mod nodes;
mod processes;
pub mod queue;
mod trouble;
mod verbs;

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::quick;

/// A study with a single value per run, whose model is a shell script.
const STUDY: &str = r#"
[study]
title = "A line"
seed = 3
[[parameter]]
name = "a"
prior = { uniform = [0, 1] }
[response]
name = "y"
axes = { place = ["here"] }
[model]
use = "external"
command = ["sh", "./model.sh", "{{ run }}", "{{ a }}", "{{ study }}"]
copy = ["model.sh"]
output = "json"
[design]
use = "latin_hypercube"
runs = 6
[measurements]
use = "csv"
path = "measured.csv"
[surrogate]
use = "polynomial_chaos"
degree = 1
[discrepancy]
use = "gaussian"
variance = { known = 0.01 }
[sampler]
use = "affine_invariant_ensemble"
walkers = 8
steps = 20
[validate]
emulator_check = 0
rerun_model = false
"#;

/// A folder with a study whose model is this script: `$1` is the run's name, `$2` its parameter, `$3` the folder of the
/// study.
pub fn study(script: &str, executor: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    fs::write(&path, format!("{STUDY}[executor]\n{executor}\n")).unwrap();
    fs::write(folder.path().join("model.sh"), script).unwrap();
    fs::write(folder.path().join("measured.csv"), "replicate,place,y\n1,here,0.4\n2,here,0.5\n")
        .unwrap();
    (folder, path)
}

/// Name and failure reason of each run; the reason is empty if the run is done.
pub fn outcomes(out: &Path) -> Vec<(String, String)> {
    let text = fs::read_to_string(out.join("2-simulate/runs.csv")).unwrap();
    let rows = text.lines().skip(1).map(|line| {
        let name = line.split(',').next().unwrap().to_owned();
        let reason = line.split('"').nth(1).unwrap().to_owned();
        assert_eq!(line.split(',').nth(2) == Some("done"), reason.is_empty(), "{line}");
        (name, reason)
    });
    rows.collect()
}

/// Failure reasons of the runs that failed, by name.
pub fn failures(out: &Path) -> Vec<(String, String)> {
    outcomes(out).into_iter().filter(|(_, reason)| !reason.is_empty()).collect()
}

/// The command `lacuna run` with its output folder.
pub fn run(path: &Path, out: &Path, settings: &[&str]) -> std::process::Command {
    let mut command = quick::command();
    command.arg("run").arg(path).arg("--out").arg(out);
    command.args(settings.iter().flat_map(|setting| ["--set", setting]));
    command
}
