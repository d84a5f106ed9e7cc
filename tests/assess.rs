//! The verdict on correct studies, and on the same studies with one fault: data and tables are modified, findings are
//! never constructed.

use std::fs;
use std::path::Path;

use lacuna_engine::assess::{Assessment, Finding, Severity};
use lacuna_engine::report::findings::Findings;
use tempfile::TempDir;

use crate::quick;

mod data;
mod draws;
mod runs;

const SHORT: [&str; 2] = ["sampler.walkers=24", "sampler.steps=2500"];

fn assess(folder: &Path, settings: &[&str]) -> Assessment {
    findings(folder, settings).assessment
}

fn findings(folder: &Path, settings: &[&str]) -> Findings {
    let path = folder.join("study.toml");
    let ran = quick::run(&path, &[&SHORT, settings].concat(), &folder.join("run"));
    ran.unwrap_or_else(|stop| panic!("{stop}")).findings
}

/// A folder with the measurements that `lacuna new study` writes, and a study that makes its own runs.
fn oscillator() -> TempDir {
    let folder = quick::tables();
    let study = quick::root().join("tests/assess/oscillator.toml");
    fs::copy(study, folder.path().join("study.toml")).unwrap();
    folder
}

fn found<'a>(assessment: &'a Assessment, code: &str, severity: Severity) -> &'a Finding {
    let found = assessment.findings.iter().find(|f| f.code == code && f.severity == severity);
    found.unwrap_or_else(|| panic!("no {severity:?} `{code}`: {:#?}", assessment.findings))
}

/// Changes the last cell of the lines of a table that begin with `begins`.
fn change(folder: &Path, file: &str, begins: &str, value: impl Fn(f64, usize) -> f64) {
    let path = folder.join(file);
    let text = fs::read_to_string(&path).unwrap();
    let mut lines: Vec<String> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let (rest, last) = line.rsplit_once(',').unwrap();
        lines.push(match last.parse::<f64>() {
            Ok(number) if i > 0 && line.starts_with(begins) => {
                format!("{rest},{}", value(number, i - 1))
            }
            _ => line.to_owned(),
        });
    }
    fs::write(path, lines.join("\n") + "\n").unwrap();
}

fn stop(folder: &TempDir, settings: &[&str]) -> String {
    let ran = quick::run(&folder.path().join("study.toml"), settings, &folder.path().join("run"));
    ran.map(|_| ()).unwrap_err().to_string()
}

#[test]
fn the_study_that_is_written_for_newcomers_is_trusted_and_says_so_first() {
    let folder = quick::tables();
    let mut command = quick::command();
    command.arg("run").arg(folder.path().join("study.toml")).args(["--strict", "--out"]);
    let output = command.arg(folder.path().join("run")).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert_eq!(text.lines().find(|line| !line.is_empty()), Some("trusted"), "{text}");
    let page = fs::read_to_string(folder.path().join("run/report.html")).unwrap();
    let (verdict, result) = (page.find("assessment trusted"), page.find("Posterior means with"));
    assert!(verdict.unwrap() < result.unwrap());
    assert_eq!(quick::summary(&folder.path().join("run"))["assessment"]["level"], "trusted");
}

#[test]
fn a_strict_run_without_trust_ends_with_its_own_exit_code() {
    let folder = quick::tables();
    change(folder.path(), "measured.csv", "", |y, _| 1e-3 * y);
    let study = folder.path().join("study.toml");
    let run = folder.path().join("run");
    let strict = |verb: &str, what: &Path, strict: bool| {
        let mut command = quick::command();
        command.arg(verb).arg(what).args(strict.then_some("--strict"));
        if verb == "run" {
            command.args(["--set", "sampler.steps=300", "--out"]).arg(&run);
        }
        quick::said(&mut command)
    };
    assert_eq!(strict("run", &study, false).0, Some(0));
    let (code, said) = strict("run", &study, true);
    assert_eq!(code, Some(3));
    assert!(said.contains("error: NOT TRUSTED"), "{said}");
    assert_eq!(strict("resume", &run, true).0, Some(3));
    assert_eq!(strict("report", &run, false).0, Some(0));
}

/// Every code of a finding has a test that provokes it with a study, here or elsewhere in this folder.
#[test]
fn every_finding_is_provoked_by_a_study() {
    let elsewhere = [
        "bad_input.rs",
        "studies.rs",
        "priors.rs",
        "predict.rs",
        "hierarchy/trained.rs",
        "intervals.rs",
        "stochastic.rs",
        "gap/workflow.rs",
    ];
    let here = ["assess/data.rs", "assess/draws.rs", "assess/runs.rs"];
    let read = |file: &&str| fs::read_to_string(quick::root().join("tests").join(file)).unwrap();
    let text: String = here.iter().chain(&elsewhere).map(read).collect();
    let provoked = |code: &str| {
        let seen = [
            format!("\"{code}\", Severity::"),
            format!("of_code(\"{code}\")"),
            format!("of_code(&findings, \"{code}\")"),
            format!("contains(\"{code}\")"),
        ];
        seen.iter().any(|call| text.contains(call))
    };
    let rules = lacuna_engine::assess::rules();
    let missing: Vec<&str> =
        rules.iter().map(|rule| rule.code).filter(|code| !provoked(code)).collect();
    assert!(missing.is_empty(), "no test provokes {missing:?}");
}
