//! Runs that are placed by what earlier runs returned: ensemble Kalman inversion, and refinement by the variance of the
//! posterior, against posteriors in closed form or integrated on a grid.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::quick;

#[path = "sequential/bench.rs"]
mod bench;
#[path = "sequential/published.rs"]
mod published;

/// A copy of the line with normal priors, whose prior is a hundred times wider than its posterior.
fn line(more: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let from = quick::root().join("configs/equations");
    fs::copy(from.join("line.csv"), folder.path().join("line.csv")).unwrap();
    let text = fs::read_to_string(from.join("line.toml")).unwrap();
    let text = text.replace("steps = 4000", "steps = 1000") + more;
    fs::write(folder.path().join("study.toml"), text).unwrap();
    folder
}

const KALMAN: &str = "\n[design]\nuse = \"ensemble_kalman\"\nruns = 16\n\n[surrogate]\nuse = \"polynomial_chaos\"\ndegree = 2\n";

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {pointer}"))
}

/// Folders of the batches in a run directory.
fn batches(out: &Path) -> Vec<String> {
    let names = fs::read_dir(out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut found: Vec<String> = names.filter(|n| n.starts_with("2-simulate-batch-")).collect();
    found.sort_by_key(|name| (name.len(), name.clone()));
    found
}

/// The posterior of a line with normal priors and noise in closed form (`configs/equations/README.md`), through the
/// emulator of the batches: the mean within 4 Monte Carlo errors, the standard deviation within 4 of its own. The
/// emulator of a line is exact.
#[test]
fn the_posterior_from_an_ensemble_is_the_closed_form() {
    let folder = line(KALMAN);
    let out = folder.path().join("out");
    let ran = quick::run(&folder.path().join("study.toml"), &[], &out).unwrap();
    assert!((2..=12).contains(&batches(&out).len()), "{:?}", batches(&out));
    let summary = quick::summary(&out);
    for (name, mean, sd) in [("level0", 1.1965, 0.0708), ("rise", -0.3520, 0.0193)] {
        let at = |key: &str| number(&summary, &format!("/parameters/{name}/{key}"));
        let error = at("mcse_mean");
        assert!(
            (at("mean") - mean).abs() < 4.0 * error + 5e-5,
            "{name}: {} +- {error}",
            at("mean")
        );
        let draws = (at("sd") / error).powi(2);
        let ratio = at("sd") / sd - 1.0;
        assert!(ratio.abs() < 4.0 / (2.0 * draws).sqrt() + 1e-3, "{name}: sd ratio {ratio}");
    }
    assert!(!ran.made.is_empty());
    // Inputs of runs that follow the data depend on each other: they are not screened.
    assert!(summary["runs"].get("screening").is_none(), "{}", summary["runs"]);
    // Nothing is made again.
    let again = quick::run(&folder.path().join("study.toml"), &[], &out).unwrap();
    assert_eq!(again.made, Vec::<String>::new());
}

/// A surrogate that does not know the covariance of its errors cannot choose by the variance of the posterior, and says so.
#[test]
fn a_rule_that_the_surrogate_cannot_follow_is_replaced_aloud() {
    let folder = line(
        "\n[design]\nuse = \"sobol\"\nruns = 20\n\n[surrogate]\nuse = \"polynomial_chaos\"\ndegree = 1\nrefine = { runs = \
         3, rounds = 1, choose = \"posterior_variance\" }\n",
    );
    let settings = ["sampler.steps=200"];
    let ran = quick::run(&folder.path().join("study.toml"), &settings, &folder.path().join("out"));
    let warnings = ran.unwrap_or_else(|stop| panic!("{stop}")).warnings;
    assert!(warnings.iter().any(|said| said.contains("as by `emulator_error`")), "{warnings:?}");
}

/// An interrupted study goes on with the same points: without its last batch and everything after it, the run makes the
/// same results as without an interruption.
#[test]
fn an_interrupted_ensemble_goes_on() {
    let folder = line(KALMAN);
    let (study, out) = (folder.path().join("study.toml"), folder.path().join("out"));
    quick::run(&study, &[], &out).unwrap();
    let before = quick::results(&out);
    let last = batches(&out).pop().unwrap();
    for entry in fs::read_dir(&out).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name == last || name.starts_with(['3', '4', '5', '6', '7', '8']) {
            fs::remove_dir_all(out.join(name)).unwrap();
        }
    }
    quick::run(&study, &[], &out).unwrap();
    assert_eq!(quick::results(&out), before);
}

/// Runs that fail are left out, and the ensemble goes on: the observed formula has no value for large positive slopes.
#[test]
fn an_ensemble_goes_on_without_failed_runs() {
    let folder = line(KALMAN);
    let path = folder.path().join("study.toml");
    quick::replace(
        &path,
        "observe = \"level\"",
        "observe = \"level + 0 {m} * sqrt(0.4 - rise / 1 {m/s})\"",
    );
    let mut text = fs::read_to_string(&path).unwrap();
    writeln!(text, "\n[simulations]\nuse = \"netcdf\"\nallow_failed = 10").unwrap();
    fs::write(&path, text).unwrap();
    let out = folder.path().join("out");
    quick::run(&path, &[], &out).unwrap();
    let summary = quick::summary(&out);
    let failed = fs::read_to_string(out.join("2-simulate/runs.csv")).unwrap();
    assert!(failed.contains("NaN"), "{failed}");
    let at = |key: &str| number(&summary, &format!("/parameters/rise/{key}"));
    assert!((at("mean") + 0.3520).abs() < 4.0 * at("mcse_mean") + 5e-5);
}

#[test]
fn the_coverage_of_such_a_design_is_refused() {
    let folder = line(KALMAN);
    let path = folder.path().join("study.toml");
    let study = quick::load(&path, &[]);
    assert!(study.design.as_ref().unwrap().built.plugin.is_sequential());
    let out = folder.path().join("out").display().to_string();
    let ended = quick::command()
        .args(["coverage", &path.display().to_string(), "--out", &out, "--count", "4"])
        .output()
        .unwrap();
    let said = String::from_utf8(ended.stderr).unwrap();
    assert!(!ended.status.success() && said.contains("sequential design"), "{said}");
}
