//! Another model in place of the study's, on data made by exact solutions: a body falling against a drag proportional
//! to the square of its speed, while the study has linear drag.

use std::fs;

use lacuna::run::Silent;
use lacuna_engine::augment::{Begun, add};
use lacuna_engine::gap::search::VerdictKind;
use lacuna_engine::report::findings::Findings;
use lacuna_engine::report::gap_text;
use lacuna_run::RunDirectory;
use tempfile::TempDir;

use super::inside::study;
use crate::quick::described::summary_of;

const STUDY: &str = r#"
[study]
name = "fall"
title = "a falling body"

[[parameter]]
name = "gravity"
unit = "m/s2"
prior = { normal = [9.81, 0.02] }

[[parameter]] # of the air
name = "drag"
unit = "1/s"
prior = { uniform = [0.0, 2.0] }

[response]
name = "x"
unit = "m"
axes = { t = { first = 0.05, last = 3.0, count = 60, unit = "s" } }

[model] # of Stokes
use = "equations"
state = { x = { start = 0.0, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
observe = "x"

[model.rate]
x = "v"
v = "gravity - drag * v"

# what a camera saw
[measurements]
use = "csv"
path = "data.csv"

[discrepancy]
use = "gaussian"
variance = { half_normal = 1.0 }

[sampler]
use = "affine_invariant_ensemble"
walkers = 16
steps = 200

[gap]
candidates = ["gain", "offset", "drift"]
simulations = 99

[[gap.model]]
name = "newton"
use = "equations"
state = { x = { start = 0.0, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "gravity - drag * v * abs(v) / 10 {m/s}" }
observe = "x"

[[gap.model]]
name = "vacuum"
use = "equations"
state = { x = { start = 0.0, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
rate = { x = "v", v = "gravity" }
observe = "x"
"#;

const GRAVITY: f64 = 9.81;
const DRAG: f64 = 0.3;
const NOISE: f64 = 0.02;

/// Quadratic drag (Parker, American Journal of Physics 45 (1977) 606, section I): `x = u² / g ln cosh(g t / u)` with
/// the terminal speed `u`, whose square is `10 g / drag`.
fn newton(t: f64) -> f64 {
    let square = 10.0 * GRAVITY / DRAG;
    square / GRAVITY * (GRAVITY * t / square.sqrt()).cosh().ln()
}

/// Linear drag (same source, section II): `x = u (t - (1 - exp(-drag t)) / drag)` with the terminal speed
/// `u = g / drag`.
fn stokes(t: f64) -> f64 {
    GRAVITY / DRAG * (t - (1.0 - (-DRAG * t).exp()) / DRAG)
}

fn times() -> Vec<f64> {
    (1..=60).map(|i| 0.05 * f64::from(i)).collect()
}

fn searched(
    curve: impl Fn(f64) -> f64,
) -> (TempDir, lacuna_engine::study::Study, RunDirectory, Findings) {
    let (folder, study) = study(STUDY, curve, &times(), NOISE);
    fs::write(folder.path().join("study.toml"), &study.text).unwrap();
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    (folder, study, run, findings)
}

#[test]
fn the_model_that_made_the_data_takes_the_place_of_the_studys() {
    let (folder, study, mut run, findings) = searched(newton);
    let gap = findings.gap.as_ref().unwrap();
    let result = &gap.result;
    assert_eq!(result.verdict.word, VerdictKind::Named, "{:?} {:?}", result.verdict, result.models);
    let told = &summary_of(&findings)["gap"];
    let effects = told["effects"].as_array().unwrap();
    assert_eq!(effects.len(), 1, "{told:#}");
    assert_eq!(
        (&effects[0]["type"], &effects[0]["name"]),
        (&"model_swap".into(), &"newton".into())
    );
    assert!(effects[0]["posterior_probability"].as_f64().unwrap() > 0.99, "{told:#}");
    assert!(told["models"]["newton"]["log_odds"].as_f64().unwrap() > 10.0, "{told:#}");
    assert!(told["models"]["vacuum"]["log_odds"].as_f64().unwrap() < -10.0, "{told:#}");
    assert_eq!(told["held_out"]["shrank"], true, "{told:#}");
    assert!(
        gap_text(&findings)
            .starts_with("The data need the model `newton` in place of the study's.")
    );
    let drag = &result.additions[0].unknowns[1];
    assert!((drag.value - DRAG).abs() < 4.0 * drag.sd, "{drag:?}");

    let path = folder.path().join("study.toml");
    let begun =
        Begun { study: &study, path: &path, folder: None, settings: &[], findings: &findings, gap };
    let (added, with) = add(&begun, &run, &Silent).unwrap();
    assert_eq!(added.study, folder.path().join("study+newton.toml"));
    let text = fs::read_to_string(&added.study).unwrap();
    // The study's own text with another model; the chosen one is no longer a candidate.
    assert!(
        text.contains("[[parameter]] # of the air") && text.contains("# what a camera saw"),
        "{text}"
    );
    assert!(!text.contains("Stokes") && text.contains("name = \"vacuum\""), "{text}");
    assert!(
        !text.contains("name = \"newton\"") && text.contains("# the model `newton` in place"),
        "{text}"
    );
    let moved = added.parameters.iter().find(|moved| moved.name == "drag").unwrap();
    assert!((moved.mean[1] - DRAG).abs() < 4.0 * moved.sd[1], "{moved:?}");
    assert!(with.calibration.is_some());
    let again = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    let told = &summary_of(&again)["gap"]["effects"][0]["parameters"]["drag"];
    assert_eq!(told["mean"].as_f64().unwrap(), moved.mean[1], "{told:#}");
}

#[test]
fn an_effect_of_the_library_is_no_other_model() {
    let (_, _, _, findings) = searched(|t| stokes(t) + 0.1);
    let result = &findings.gap.as_ref().unwrap().result;
    let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    assert_eq!(
        (result.verdict.word, &kinds[..]),
        (VerdictKind::Named, &["offset"][..]),
        "{:?}",
        result.models
    );
}

#[test]
fn a_model_and_an_effect_are_found_together() {
    let (_, _, _, findings) = searched(|t| newton(t) + 0.1);
    let result = &findings.gap.as_ref().unwrap().result;
    let kinds: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    assert_eq!(kinds, ["model_swap", "offset"], "{:?} {:?}", result.verdict, result.models);
    assert_eq!(result.verdict.word, VerdictKind::Named, "{:?}", result.verdict);
    // Two replicates are too few for a useful interval.
    assert!(result.held_out[0].proof.all.closed > 0.9, "{:?}", result.held_out);
}

#[test]
fn where_nothing_is_missing_no_other_model_is_named() {
    let (_, _, _, findings) = searched(stokes);
    let result = &findings.gap.as_ref().unwrap().result;
    assert_eq!(result.verdict.word, VerdictKind::None, "{:?} {:?}", result.verdict, result.models);
    assert!(result.additions.is_empty());
}
