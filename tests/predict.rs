//! Predictions under conditions that were not measured: a straight line whose slope depends on a condition, against its
//! exact normal posterior and against data of an independent generator.

use std::fs;
use std::path::Path;

use generator::{line, noise};
use serde_json::Value;
use tempfile::TempDir;

use crate::quick;

const SD: f64 = 0.5;
const TRUTH: [f64; 2] = [0.7, -0.4];

/// Multiple of a Monte Carlo error: exceeded with a probability of 6e-5 per figure.
const ERRORS: f64 = 4.0;

/// Factor of the slope in the scenario without measurements; it is 1 where there are some.
const STEEP: f64 = 3.0;

const QUANTITIES: &str = r#"
[[quantity]]
name = "level_there"
use = "at"
place = 3.0
include = []

[[quantity]]
name = "record"
use = "at"
place = 3.0
include = ["emulator", "numerics", "model_form", "measurement"]

[[quantity]]
name = "growth"
use = "expression"
formula = "level_there * slope"
on = { scenario = ["steep"] }
"#;

const SCENARIOS: &str = r#"
[[scenario]]
name = "plain"
values = { slope = 1.0 }

[[scenario]]
name = "steep"
values = { slope = 3.0 }
measured = false

[response]"#;

/// The study of a line with a second condition, by the model itself.
fn written(more: &str) -> (TempDir, line::Posterior) {
    let folder = tempfile::tempdir().unwrap();
    let data = line::replicates(TRUTH, SD, 4, &mut noise::Source::new(5));
    fs::write(folder.path().join("plain.csv"), line::table(&data)).unwrap();
    let text = fs::read_to_string(quick::root().join("tests/gate/study.toml")).unwrap();
    let (before, rest) = text.split_once("[simulations]").unwrap();
    let (_, rest) = rest.split_once("[measurements]").unwrap();
    let (measurements, rest) = rest.split_once("[surrogate]").unwrap();
    let (_, after) = rest.split_once("[discrepancy]").unwrap();
    let model = "[model]\nuse = \"equations\"\nobserve = \"level0 + rise * slope * t\"\n";
    let before = before.replace("[response]", SCENARIOS);
    let measurements = measurements.replace("line.csv", "{scenario}.csv");
    let text = format!(
        "{before}{model}{more}\n[measurements]{measurements}\n[discrepancy]{after}{QUANTITIES}"
    );
    fs::write(folder.path().join("study.toml"), text).unwrap();
    (folder, line::posterior(&data, SD))
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {pointer}"))
}

/// Requires mean and standard deviation within their Monte Carlo errors.
fn agrees(what: &str, found: &Value, mean: f64, sd: f64) {
    let error = number(found, "/mcse_mean");
    let draws = (number(found, "/sd") / error).powi(2);
    let off = number(found, "/mean") - mean;
    assert!(off.abs() < ERRORS * error, "{what}: mean off by {off}, error {error}");
    let ratio = number(found, "/sd") / sd;
    assert!((ratio - 1.0).abs() < ERRORS / (2.0 * draws).sqrt(), "{what}: sd ratio {ratio}");
}

fn check(folder: &Path, exact: &line::Posterior) {
    let ran = quick::run(&folder.join("study.toml"), &[], &folder.join("out"));
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    let summary = quick::summary(&folder.join("out"));
    let found = &summary["quantities"];
    let [[a, b], [_, c]] = exact.covariance;
    let response = |slope: f64| {
        let x = 3.0 * slope;
        (exact.mean[0] + x * exact.mean[1], (a + 2.0 * x * b + x * x * c).sqrt())
    };
    for (name, slope) in [("plain", 1.0), ("steep", STEEP)] {
        let (mean, sd) = response(slope);
        agrees(name, &found[format!("level_there[{name}]")], mean, sd);
        // The scatter of a new replicate is that of the measured scenario.
        let record = &found[format!("record[{name}]")];
        agrees(name, record, mean, (sd * sd + SD * SD).sqrt());
    }
    let (mean, sd) = response(STEEP);
    agrees("growth", &found["growth[steep]"], STEEP * mean, STEEP * sd);
    // Truth, from the generator: new records at the other condition.
    let truth = TRUTH[0] + 3.0 * STEEP * TRUTH[1];
    assert!((truth - mean).abs() < 3.0 * sd, "{truth} {mean} {sd}");
    let mut random = noise::Source::new(77);
    let records = line::replicates([TRUTH[0], STEEP * TRUTH[1]], SD, 4000, &mut random);
    let at = line::TIMES.iter().position(|t| *t == 3.0).unwrap();
    let inside = |value: f64| {
        let record = &found["record[steep]"];
        (number(record, "/q025")..=number(record, "/q975")).contains(&value)
    };
    let share = records.iter().filter(|values| inside(values[at])).count() as f64 / 4000.0;
    // Given this posterior the interval of the mixture is that much off the truth: its exact content for new records.
    let total = (sd * sd + SD * SD).sqrt();
    let content = |end: f64| normal_share((mean + end * total - truth) / SD);
    let expected = content(1.959_964) - content(-1.959_964);
    // The ends of the interval have Monte Carlo errors of about 2.7 times that of the mean.
    let density = 0.4 * (-0.5 * ((mean + 1.96 * total - truth) / SD).powi(2)).exp() / SD;
    let ends = 2.0 * density * 2.7 * number(&found["record[steep]"], "/mcse_mean");
    let error = (expected * (1.0 - expected) / 4000.0 + ends * ends).sqrt();
    assert!((share - expected).abs() < ERRORS * error, "{share} {expected} {error}");
    // The result says that it is an extrapolation.
    assert!(summary["assessment"].to_string().contains("unmeasured_conditions"));
    let findings = summary["assessment"]["findings"].as_array().unwrap();
    let said = findings.iter().find(|f| f["code"] == "unmeasured_conditions").unwrap();
    assert_eq!((&said["where"], &said["severity"]), (&"steep".into(), &"note".into()));
}

/// Normal distribution function by the series of Marsaglia (Journal of Statistical Software 11 (2004) 4).
fn normal_share(x: f64) -> f64 {
    let (mut sum, mut term, mut k) = (x, x, 1.0);
    while f64::abs(term) > 1e-17 * f64::abs(sum) && k < 400.0 {
        k += 2.0;
        term *= x * x / k;
        sum += term;
    }
    0.5 + sum * (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

#[test]
fn another_condition_by_the_model_itself() {
    let (folder, exact) = written("");
    check(folder.path(), &exact);
}

/// The surrogate is trained on runs under all conditions, those without measurements too.
#[test]
fn another_condition_by_a_surrogate() {
    let more = "\n[design]\nuse = \"latin_hypercube\"\nruns = 40\n\n[surrogate]\nuse = \"polynomial_chaos\"\n\
                degree = { max = 1 }\nvalidation = 0\n";
    let (folder, exact) = written(more);
    check(folder.path(), &exact);
}

#[test]
fn conditions_that_are_predicted_are_a_scenario_without_measurements() {
    let summary = |text: &str, folder: &Path| {
        fs::write(folder.join("study.toml"), text).unwrap();
        let ran = quick::run(&folder.join("study.toml"), &[], &folder.join("out"));
        ran.unwrap_or_else(|stop| panic!("{stop}"));
        let summary = fs::read_to_string(folder.join("out/summary.json")).unwrap();
        serde_json::from_str::<Value>(&summary).unwrap()["quantities"].clone()
    };
    let (first, _) = written("");
    let scenario = fs::read_to_string(first.path().join("study.toml")).unwrap();
    let long = "[[scenario]]\nname = \"steep\"\nvalues = { slope = 3.0 }\nmeasured = false\n";
    let predict =
        scenario.replace(long, "[[predict]]\nname = \"steep\"\nvalues = { slope = 3.0 }\n");
    assert_ne!(predict, scenario);
    let (second, _) = written("");
    let (one, other) = (summary(&scenario, first.path()), summary(&predict, second.path()));
    assert!(one.get("record[steep]").is_some(), "{one}");
    assert_eq!(one, other);
}
