//! Shipped studies of cheap models, run as they are, compared with closed forms.

use std::path::Path;

use serde_json::Value;

use crate::quick;

/// Runs a study of `configs` and returns its summary.
fn summary(study: &str, settings: &[&str], out: &Path) -> Value {
    let path = quick::root().join("configs").join(study);
    quick::run(&path, settings, out).unwrap_or_else(|stop| panic!("{stop}"));
    quick::summary(out)
}

/// Checks means and standard deviations of a normal posterior to four Monte Carlo errors, which are `sd / √n` and
/// `sd / √2n` for `n` independent draws.
pub fn is_normal(summary: &Value, exact: &[(&str, f64, f64)]) {
    assert_eq!(summary["converged"], true, "{}", summary["verdict"]);
    for &(name, mean, sd) in exact {
        let found = &summary["parameters"][name];
        let number = |key: &str| found[key].as_f64().unwrap_or_else(|| panic!("{name}: {found}"));
        let size = number("ess_bulk").min(number("ess_tail"));
        let error = (number("mean") - mean).abs() / (sd / size.sqrt());
        assert!(error < 4.0, "the mean of {name} is {} and not {mean}: {error}", number("mean"));
        let error = (number("sd") / sd - 1.0).abs() * (2.0 * size).sqrt();
        assert!(error < 4.0, "the sd of {name} is {} and not {sd}: {error}", number("sd"));
    }
}

fn has_evidence(summary: &Value, exact: f64) {
    let [log, error] = ["log", "error"].map(|key| summary["evidence"][key].as_f64().unwrap());
    assert!((log - exact).abs() < 4.0 * error.max(1e-3), "{log} ± {error}, not {exact}");
}

const RECORDS: [(&str, f64, f64); 8] = [
    ("gravity", 9.759_317, 0.039_032),
    ("resistance", 0.342_941, 0.003_707),
    ("start[gentle]", 0.104_541, 0.003_238),
    ("start[middle]", -0.053_766, 0.002_255),
    ("start[steep]", 0.297_271, 0.002_655),
    ("speed[gentle]", 0.192_723, 0.003_729),
    ("speed[middle]", 0.003_006, 0.003_712),
    ("speed[steep]", -0.493_177, 0.006_771),
];
const RECORDS_EVIDENCE: f64 = 736.335_411;

/// The posterior of `y = X θ + e` with `e ~ N(0, s²)` and `θ ~ N(m, S)`: `V = (S⁻¹ + X'X/s²)⁻¹` and
/// `V (S⁻¹ m + X'y/s²)`; the evidence is `N(y; X m, X S X' + s²)`. Computed with `numpy` from the tables of the
/// studies.
#[test]
fn records_of_different_lengths_have_the_posterior_of_the_closed_form() {
    let folder = tempfile::tempdir().unwrap();
    let found = summary("records/study.toml", &[], folder.path());
    is_normal(&found, &RECORDS);
    has_evidence(&found, RECORDS_EVIDENCE);
    assert_eq!(found["data"]["count"], 243);
    assert!(found["surrogate"].is_null() && found["runs"].is_null());
    // asin(resistance / gravity) in degrees, to first order about the means: the relative standard deviations are 0.4 %
    // and 1.1 %, with correlation 0.887.
    let angle = &found["parameters"]["resting_angle"];
    assert_eq!((angle["role"].as_str(), angle["unit"].as_str()), (Some("derived"), Some("deg")));
    let ratio: f64 = 0.342_941 / 9.759_317;
    let [a, b] = [0.003_707 / 0.342_941, 0.039_032 / 9.759_317_f64];
    let sd = (a * a + b * b - 2.0 * 0.887_011 * a * b).sqrt() * ratio.to_degrees();
    let [mean, found] = ["mean", "sd"].map(|key| angle[key].as_f64().unwrap());
    assert!((mean - ratio.asin().to_degrees()).abs() < 0.2 * sd, "{mean}");
    assert!((found / sd - 1.0).abs() < 0.15, "{found} {sd}");
}

/// A surrogate of degree one is exact for this model: the same closed form, by way of runs of every scenario, an
/// emulator of all blocks and compressed likelihoods.
#[test]
fn records_with_a_surrogate_have_the_same_posterior() {
    let folder = tempfile::tempdir().unwrap();
    let settings = [
        "design.use=\"sobol\"",
        "design.runs=64",
        "surrogate.use=\"polynomial_chaos\"",
        "surrogate.degree=1",
        "discrepancy.emulator_error=false",
    ];
    let found = summary("records/study.toml", &settings, folder.path());
    is_normal(&found, &RECORDS);
    has_evidence(&found, RECORDS_EVIDENCE);
    for scenario in ["1-gentle", "2-middle", "3-steep"] {
        assert!(folder.path().join("2-simulate").join(scenario).join("runs.csv").is_file());
    }
    assert_eq!(found["runs"]["used"], 64);
}

/// The closed form is in the README of the study.
#[test]
fn a_line_of_equations_has_the_posterior_of_the_closed_form() {
    let folder = tempfile::tempdir().unwrap();
    let found = summary("equations/line.toml", &[], folder.path());
    is_normal(&found, &[("level0", 1.1965, 0.0708), ("rise", -0.3520, 0.0193)]);
    has_evidence(&found, 2.465);
}

/// `Σ x y / Σ x²` with standard deviation `0.01 / √Σ x²` (README of the study): the bias described in the paper.
#[test]
fn the_simple_machine_is_precise_and_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let found = summary("simple_machine/study.toml", &[], folder.path());
    let efficiency = &found["parameters"]["efficiency"];
    let [mean, sd] = ["mean", "sd"].map(|key| efficiency[key].as_f64().unwrap());
    assert!((mean - 0.5663).abs() < 2e-4 && (sd / 5.4e-4 - 1.0).abs() < 0.15, "{mean} {sd}");
    assert!((0.65 - mean) / sd > 100.0);
}

/// The posterior by quadrature over efficiency, size and length of the bias, with the probabilities of the conditions by
/// the multivariate normal distribution of scipy 1.17 (README of the study).
#[test]
fn knowledge_of_its_losses_recovers_the_efficiency_of_the_simple_machine() {
    let folder = tempfile::tempdir().unwrap();
    let short = [
        "response.axes.effort.count=11",
        "measurements.path=\"work_11.csv\"",
        "sampler.walkers=12",
        "sampler.steps=250",
    ];
    let found = summary("simple_machine/knowledge.toml", &short, folder.path());
    let efficiency = &found["parameters"]["efficiency"];
    let number = |key: &str| efficiency[key].as_f64().unwrap();
    let independent = number("ess_bulk").min(number("ess_tail"));
    let error = (number("mean") - KNOWLEDGE[0]).abs();
    assert!(error < 4.0 * KNOWLEDGE[1] / independent.sqrt() + 5e-4, "{error} {efficiency}");
    let error = (number("sd") / KNOWLEDGE[1] - 1.0).abs();
    assert!(error < 4.0 / (2.0 * independent).sqrt() + 0.02, "{error} {efficiency}");
    assert!(number("q025") < 0.65 && 0.65 < number("q975"), "{efficiency}");
}

/// Mean and standard deviation; the lattice of the conditions adds the last terms of the tolerances.
const KNOWLEDGE: [f64; 2] = [0.6400, 0.0212];

#[test]
fn an_oscillator_of_equations_finds_its_truth() {
    let folder = tempfile::tempdir().unwrap();
    let short = ["sampler.warm_up=150", "sampler.steps=450"];
    let found = summary("equations/oscillator.toml", &short, folder.path());
    for (name, truth) in [("stiffness", 90.0), ("damping", 1.1)] {
        let [mean, sd] = ["mean", "sd"].map(|key| found["parameters"][name][key].as_f64().unwrap());
        assert!((mean - truth).abs() < 3.0 * sd, "{name}: {mean} ± {sd}");
    }
}

const CHAIN: [(&str, f64); 4] =
    [("peak", 40.0), ("stiffness", 90.0), ("damping", 1.5), ("lag", 0.06)];

/// The data were made by `examples/blow.py` with the load of the first study; the second study replaces that part.
#[test]
fn a_chain_finds_its_truth_and_the_evidence_tells_its_load_from_another() {
    let short = ["design.runs=400", "sampler.warm_up=200", "sampler.steps=300"];
    let evidence = |summary: &Value| summary["evidence"]["log"].as_f64().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let right = summary("composed/study.toml", &short, &folder.path().join("right"));
    for (name, truth) in CHAIN {
        let [mean, sd] = ["mean", "sd"].map(|key| right["parameters"][name][key].as_f64().unwrap());
        assert!((mean - truth).abs() < 3.0 * sd, "{name}: {mean} ± {sd}");
        assert!(sd < 0.02 * truth, "{name}: {sd}");
    }
    let wrong = summary("composed/square_blow.toml", &short, &folder.path().join("wrong"));
    assert!(evidence(&right) - evidence(&wrong) > 100.0);
}

/// A command in place of a formula: a part with another `use` is called and gives the same result; the options of its
/// model, including `output`, belong to it.
#[test]
fn a_part_of_a_chain_is_swapped_by_its_use() {
    let path = quick::root().join("configs/composed/study.toml");
    let swapped = [
        "model.parts.load.use=external",
        "model.parts.load.command=[\"echo\", \"{{ peak }}\"]",
        "model.parts.load.output=json",
        "model.parts.load.takes=[\"peak\"]",
    ];
    let study = quick::load(&path, &swapped);
    let parts = study.resolved["model"]["parts"].as_array().unwrap();
    let names = parts.iter().map(|part| part["name"].as_str().unwrap());
    assert_eq!(names.collect::<Vec<_>>(), ["load", "response", "sensor"]);
    assert_eq!(parts[0]["gives"]["name"].as_str(), Some("force"));
    assert!(parts[0].get("observe").is_none());
}
