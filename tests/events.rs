//! `--events`: what a command says, for programs.

use std::path::Path;

use serde_json::Value;

use crate::quick;

/// Events of a command, its exit code and what it printed on standard error.
fn events(arguments: &[&str]) -> (Vec<Value>, Option<i32>, String) {
    let output = quick::command().args(arguments).arg("--events").output().unwrap();
    let lines = String::from_utf8(output.stdout).unwrap();
    let events = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    (events, output.status.code(), String::from_utf8(output.stderr).unwrap())
}

fn of<'a>(events: &'a [Value], kind: &str) -> Vec<&'a Value> {
    events.iter().filter(|event| event["event"] == kind).collect()
}

#[test]
fn a_run_is_told_as_events() {
    let folder = quick::tables();
    let [study, out] =
        ["study.toml", "run"].map(|name| folder.path().join(name).display().to_string());
    let (all, code, said) = events(&["run", &study, "--out", &out]);
    assert_eq!((code, said.as_str()), (Some(0), ""));
    let stages = |kind| of(&all, kind).iter().map(|e| e["stage"].clone()).collect::<Vec<_>>();
    for stage in stages("begin") {
        assert!(stages("done").contains(&stage), "{stage} has no end");
    }
    assert!(stages("done").iter().any(|stage| stage == "calibrate"), "{all:?}");
    assert!(of(&all, "done").iter().all(|e| e["seconds"].as_f64().is_some_and(|s| s >= 0.0)));
    let result = of(&all, "result");
    for file in ["report", "summary"] {
        assert!(Path::new(result[0][file].as_str().unwrap()).is_file(), "{result:?}");
    }
    let last = all.last().unwrap();
    assert_eq!((&last["event"], &last["code"]), (&"end".into(), &0.into()));
}

#[test]
fn an_error_is_told_as_an_event_and_to_people() {
    let (all, code, said) = events(&["run", "no_such_study.toml"]);
    let last = all.last().unwrap();
    assert_eq!((code, last["code"].as_i64()), (Some(2), Some(2)));
    assert!(last["error"].as_str().unwrap().contains("no_such_study.toml"), "{last}");
    assert!(said.contains("no_such_study.toml"), "{said}");
}
