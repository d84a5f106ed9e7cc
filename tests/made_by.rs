//! Results made by another version of the program: which are reused, which are repeated, and the messages about both.

use std::fs;

use lacuna::run::files;
use serde_json::Value;

use crate::quick;

#[test]
fn another_version_takes_the_runs_and_makes_the_rest_again() {
    let folder = quick::simulated();
    let (study, out) = (folder.path().join("study.toml"), folder.path().join("run"));
    let run = |version: &str| {
        quick::run_as(version, &study, &[], &out).unwrap_or_else(|stop| panic!("{stop}"))
    };
    assert_eq!(run("0.0.9").notes, [""; 0]);
    let first = quick::results(&out);
    let later = run("0.1.0");
    let again = ["3-read", "4-surrogate", "5-calibrate", "6-evidence", "6-validate", "6-assess"];
    assert_eq!(later.made, again);
    // One line per stage: two are reused, six repeated.
    let taken = ["1-design", "2-simulate"]
        .map(|stage| format!("`{stage}` is reused as made by lacuna 0.0.9"));
    assert_eq!(later.notes[..2], taken);
    assert_eq!(later.notes.len(), 8, "{:?}", later.notes);
    for (stage, note) in again.iter().zip(&later.notes[2..]) {
        assert!(note.starts_with(&format!("`{stage}` is repeated: ")), "{note}");
        assert!(note.contains("lacuna 0.0.9"), "{note}");
    }
    // The numbers are the same; only the version that made them differs.
    let mut second = quick::results(&out);
    let summary = |results: &mut std::collections::BTreeMap<String, String>| {
        results.remove("summary.json").unwrap()
    };
    let (before, after) = (summary(&mut first.clone()), summary(&mut second));
    let version = |text: &str, stage: &str| {
        let summary: Value = serde_json::from_str(text).unwrap();
        summary["made_by"][stage].as_str().unwrap().to_owned()
    };
    for (stage, made) in [("design", "0.0.9"), ("simulate", "0.0.9"), ("calibrate", "0.1.0")] {
        assert_eq!(version(&before, stage), "0.0.9");
        assert_eq!(version(&after, stage), made);
    }
    let numbers = |text: &str| serde_json::from_str::<Value>(text).unwrap()["parameters"].clone();
    assert_eq!(numbers(&before), numbers(&after));
    let manifest: Value = files::read_json(&out.join("manifest.json")).unwrap();
    let stages = manifest["stages"].as_array().unwrap();
    assert_eq!(stages[1]["lacuna"], "0.0.9");
    assert_eq!(stages[4]["made_by"]["lacuna"], "0.1.0");
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(report.contains("by lacuna 0.0.9"), "the report names no other version");
    // Nothing is lost: the older version finds all its own results.
    assert_eq!(run("0.0.9").made, [""; 0]);
    assert_eq!(run("0.1.0").made, [""; 0]);
}

/// A chain is never made partly by one version and partly by another.
#[test]
fn an_unfinished_chain_of_another_version_is_begun_anew() {
    let folder = quick::simulated();
    let (study, out) = (folder.path().join("study.toml"), folder.path().join("run"));
    quick::run_as("0.0.9", &study, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    let stage = out.join("5-calibrate");
    let state = fs::read(stage.join("state.json")).unwrap();
    let checkpoint: Value = serde_json::from_slice(&state).unwrap();
    let inputs = fs::read_to_string(stage.join("inputs.sha256")).unwrap();
    assert_eq!(checkpoint["inputs"], inputs.trim());
    // Simulates a chain of another version under the inputs of this one: its state must not be used.
    let whole = quick::results(&out);
    let mut foreign = checkpoint;
    foreign["inputs"] = "another".into();
    foreign["step"] = 7.into();
    fs::write(stage.join("state.json"), foreign.to_string()).unwrap();
    fs::remove_file(stage.join("stage.json")).unwrap();
    quick::run_as("0.0.9", &study, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    assert_eq!(quick::results(&out), whole);
}

/// Other measurements of the same response repeat what depends on them; the surrogate depends on the runs only.
#[test]
fn a_surrogate_is_reused_with_other_measurements() {
    let folder = quick::tables();
    let (study, out) = (folder.path().join("study.toml"), folder.path().join("run"));
    quick::run(&study, &[], &out).unwrap();
    quick::replace(&folder.path().join("measured.csv"), "1,0.05,0.77548", "1,0.05,0.77551");
    let again = quick::run(&study, &[], &out).unwrap();
    let is_made = |stage: &str| again.made.iter().any(|made| made == stage);
    assert!(is_made("3-read") && is_made("5-calibrate"), "{:?}", again.made);
    assert!(!is_made("4-surrogate"), "{:?}", again.made);
}
