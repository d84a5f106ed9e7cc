//! The studies of `docs/coming_from.md` and `docs/my_model.md` give the numbers that the pages state.

use std::fs;

use serde_json::Value;

use super::markdown::Page;
use super::root;
use crate::commands::there_is_python;
use crate::quick::command;

/// Runs the study of a page that has this title, with files beside it, and returns its parameters of `summary.json`.
fn parameters(page: &str, title: &str, files: &[(&str, &str)]) -> Value {
    let blocks = Page::read(&root().join(page)).blocks("toml");
    let study = blocks.iter().find(|block| block.text.contains(title)).expect("the study");
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files.iter().chain(&[("study.toml", study.text.as_str())]) {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let mut run = command();
    run.current_dir(folder.path()).args(["run", "study.toml", "--out", "run"]);
    let ran = run.output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let summary = fs::read_to_string(folder.path().join("run/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    summary["parameters"].clone()
}

/// Demands mean and standard deviation of a parameter. The chains have about 1000 effective draws: 0.13 standard deviations are
/// four Monte Carlo errors of the mean, and 15 % are three of the standard deviation of a posterior with heavy tails.
fn demand(parameters: &Value, name: &str, mean: f64, sd: f64) {
    let found = ["mean", "sd"].map(|key| parameters[name][key].as_f64().unwrap());
    let near = (found[0] - mean).abs() < 0.13 * sd && (found[1] / sd - 1.0).abs() < 0.15;
    assert!(near, "{name}: {found:?}, expected {mean} and {sd}");
}

/// Sums over a grid of modulus, load and variance, with `numpy`.
#[test]
fn the_beam_has_the_posterior_of_a_grid() {
    let data = "replicate,deflection [mm]\n1,12.84\n2,13.12\n3,12.13\n4,12.19\n5,12.67\n";
    let found = parameters("docs/coming_from.md", "a beam", &[("beam.csv", data)]);
    demand(&found, "E", 24.08, 1.76);
    demand(&found, "p", 12281.0, 568.0);
}

/// Sums over a grid of slope, level and fraction, with `numpy`.
#[test]
fn the_line_has_the_posterior_of_a_grid() {
    let found = parameters("docs/coming_from.md", "A straight line", &[]);
    demand(&found, "m", -1.044, 0.221);
    demand(&found, "b", 5.61, 1.31);
}

/// The same data with finished runs of the same oscillator: the table of the tutorial.
#[test]
fn a_function_in_python_gives_what_finished_runs_give() {
    if !there_is_python() {
        return;
    }
    let functions = Page::read(&root().join("docs/my_model.md")).blocks("python");
    let data = fs::read_to_string(root().join("cli/src/new/measured.csv")).unwrap();
    let files = [("oscillator.py", functions[0].text.as_str()), ("measured.csv", data.as_str())];
    let found = parameters("docs/my_model.md", "A function in Python", &files);
    demand(&found, "frequency", 1.9012, 0.0019);
    demand(&found, "damping", 1.388, 0.0114);
}
