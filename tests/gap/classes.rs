//! A class keeps its members: a study each, and averages over them.

use std::fs;
use std::path::Path;

use generator::{Kind, PARAMETERS, SAMPLES, SENSORS, times};
use lacuna::run::Silent;
use lacuna_engine::augment::{Begun, add};
use lacuna_engine::gap::search::VerdictKind;
use lacuna_engine::pipeline;
use lacuna_engine::report::gap_text;
use lacuna_engine::study::resolve;
use lacuna_run::RunDirectory;

use crate::quick::described::summary_of;
use crate::quick::replace;

/// Number of times in the study: every second sample.
const TIMES: usize = SAMPLES / 2;

/// Writes the study of `configs/hidden_effect` with other data, at every second time.
fn written(folder: &Path, case: &generator::Case) {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hidden_effect/study.toml");
    fs::copy(from, folder.join("study.toml")).unwrap();
    replace(&folder.join("study.toml"), "last = 9.9, count = 100", "last = 9.8, count = 50");
    for (scenario, replicates) in ["knock", "sweep"].iter().zip(&case.replicates) {
        let mut text = "replicate,sensor,time,y\n".to_owned();
        for (r, replicate) in replicates.iter().enumerate() {
            for (curve, sensor) in replicate.chunks(SAMPLES).zip(SENSORS) {
                for (time, y) in times().iter().zip(curve).step_by(2) {
                    text.push_str(&format!("{},{sensor},{time:.1},{y:.6}\n", r + 1));
                }
            }
        }
        fs::write(folder.join(format!("{scenario}.csv")), text).unwrap();
    }
}

/// A delay of one sensor looks like a low-pass filter to first order: few replicates cannot tell them apart. Both
/// studies are written and run, and the averages are those of the two posteriors by the members' probabilities: the
/// mean exactly, the standard deviation by the law of total variance. The truth lies within four of these.
#[test]
fn the_members_of_a_class_are_run_and_averaged() {
    let case = generator::case(606, &[(Kind::Delay, vec![0])], 0.5, 8);
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), &case);
    let path = folder.path().join("study.toml");
    let settings = [
        "sampler.walkers=24".to_owned(),
        "sampler.steps=120".to_owned(),
        "gap.simulations=99".to_owned(),
        "gap.candidates=[\"delay\", \"low_pass\"]".to_owned(),
    ];
    let study = resolve::load(&path, &settings).study.unwrap();
    let mut run = RunDirectory::open(&folder.path().join("runs/base")).unwrap();
    let findings = pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    let gap = findings.gap.as_ref().unwrap();
    assert_eq!(gap.result.verdict.word, VerdictKind::Class, "{:?}", gap.result.verdict);
    let begun = Begun {
        study: &study,
        path: &path,
        folder: None,
        settings: &settings,
        findings: &findings,
        gap,
    };
    let (added, _) = add(&begun, &run, &Silent).unwrap();
    let again = pipeline::run(&study, &mut run, &Silent).unwrap();
    let summary = summary_of(&again);
    let told = &summary["gap"];

    let mut kinds: Vec<&str> =
        added.members.iter().flat_map(|m| &m.kinds).map(String::as_str).collect();
    kinds.sort_unstable();
    assert_eq!(kinds, ["delay", "low_pass"]);
    let sum: f64 = added.members.iter().map(|member| member.weight).sum();
    assert!((sum - 1.0).abs() < 1e-12);
    for (k, member) in added.members.iter().enumerate() {
        assert!(member.study.is_file() && member.run.join("summary.json").is_file(), "{member:?}");
        let own = &told["members"][k];
        assert_eq!(own["type"].as_str().unwrap(), member.kinds.join(" + "));
        assert_eq!(own["study"].as_str().unwrap(), member.study.to_str().unwrap());
        assert!(own["parameters"].as_object().unwrap().len() >= 5, "{own:#}");
    }
    for (name, truth) in PARAMETERS.iter().zip(case.truth) {
        let own = |member: &lacuna_engine::gap::result::added::MemberRun| {
            let found = member.unknowns.iter().find(|u| u.name == *name).unwrap();
            (member.weight, found.mean, found.sd)
        };
        let parts: Vec<(f64, f64, f64)> = added.members.iter().map(own).collect();
        let mean: f64 = parts.iter().map(|(w, m, _)| w * m).sum();
        let variance: f64 = parts.iter().map(|(w, m, s)| w * (s * s + (m - mean).powi(2))).sum();
        let average = &told["averaged"][name];
        let number = |key: &str| average[key].as_f64().unwrap();
        assert!((number("mean") - mean).abs() < 1e-9, "{name}: {average:#} {mean}");
        assert!((number("sd") / variance.sqrt() - 1.0).abs() < 1e-6, "{name}: {average:#}");
        assert!(number("q025") < number("median") && number("median") < number("q975"));
        assert!((number("mean") - truth).abs() < 4.0 * number("sd"), "{name}: {average:#} {truth}");
    }
    assert!(gap_text(&again).contains("Members of the class by probability: "));
    let page = fs::read_to_string(run.root().join("report.html")).unwrap();
    assert!(page.contains("averaged over the members"));
    let table = fs::read_to_string(run.root().join("7-gap/averaged.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 2 * SENSORS.len() * TIMES);
}
