//! The emulator of a study with parameters by group: trained once, on the inputs of the model.

use std::fmt::Write as _;
use std::fs;

use generator::noise::Source;

use super::{number, run};
use crate::quick;

const STIFFNESS: [(&str, f64); 3] = [("T24", 1.9), ("T26", 2.0), ("T27", 2.2)];

/// A study whose model is simulated: the response of three targets under the same conditions, and the prediction for a fourth.
const STUDY: &str = r#"
[study]
name = "trained"
title = "Three targets"
seed = 3

[[parameter]]
name = "stiffness"
by = "target"
population = { log_normal = { median = { log_uniform = [1.5, 2.7] }, sd = { half_normal = 0.1 } } }
design = { uniform = [0.9, 3.6] }

[[parameter]]
name = "rate"
unit = "1/s"
prior = { uniform = [0.5, 1.5] }

[[predict]]
name = "T28"
labels = { target = "T28" }

[[quantity]]
name = "first"
use = "at"
place = 0.25

[response]
name = "strain"
axes = { t = { first = 0.25, last = 2.0, count = 8, unit = "s" } }

[model]
use = "equations"
observe = "exp(-rate * t) / stiffness"

[design]
use = "sobol"
runs = 48

[measurements]
use = "csv"
path = "strain.csv"
groups = "target"

[surrogate]
use = "polynomial_chaos"
validation = 8

[discrepancy]
use = "gaussian"
variance = { known = 1e-4 }

[sampler]
use = "affine_invariant_ensemble"
walkers = 32
steps = 300
"#;

fn measured(seed: u64) -> String {
    let mut random = Source::new(seed);
    let mut table = "target,replicate,t [s],strain\n".to_owned();
    for (name, stiffness) in STIFFNESS {
        for curve in 0..4 {
            for i in 1..=8 {
                let t = 0.25 * f64::from(i);
                let y = (-t).exp() / stiffness + 0.01 * random.normal();
                writeln!(table, "{name},{name}-{curve},{t},{y}").unwrap();
            }
        }
    }
    table
}

#[test]
fn targets_under_the_same_conditions_share_runs_and_emulator() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), STUDY).unwrap();
    fs::write(folder.path().join("strain.csv"), measured(1)).unwrap();
    run(folder.path(), &[]);
    let out = folder.path().join("out");
    let summary = quick::summary(&out);
    // One run for each point of the design, in two dimensions.
    let runs = fs::read_to_string(out.join("2-simulate/runs.csv")).unwrap();
    assert_eq!(runs.lines().filter(|line| line.starts_with("run0")).count(), 48);
    let heading = runs.lines().find(|line| line.starts_with("run,")).unwrap();
    assert!(heading.contains("stiffness") && !heading.contains("T24"), "{heading}");
    for (name, stiffness) in STIFFNESS {
        let found = &summary["parameters"][format!("stiffness[{name}]")];
        let off = number(found, "/mean") - stiffness;
        assert!(off.abs() < 4.0 * number(found, "/sd"), "{name}: {off}");
        assert!(number(found, "/sd") < 0.05, "{found}");
    }
    // The new target has the scatter between targets, and the response of its own stiffness.
    let new = &summary["parameters"]["stiffness[T28]"];
    assert!(number(new, "/sd") > 0.1, "{new}");
    let [first, of_known] =
        ["T28", "T24"].map(|name| number(&summary, &format!("/quantities/first[{name}]/sd")));
    assert!(first > 5.0 * of_known, "{first}, {of_known}");
    // Three groups say little about the scatter.
    assert!(summary["assessment"].to_string().contains("few_groups"), "{}", summary["assessment"]);
    // The design is shown in the inputs of the model, and not once for each target.
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let (_, design) = page.split_once("id=\"ensemble\"").unwrap();
    let (design, _) = design.split_once("id=\"measurements\"").unwrap();
    assert!(design.contains("stiffness") && !design.contains("stiffness["), "{design}");
    assert!(!design.contains("stiffness.median"), "{design}");
    // So are their effects.
    let screened = &summary["runs"]["screening"];
    let acts = |input: &str| screened[input]["acts"] == true;
    assert!(acts("stiffness") && acts("rate"), "{screened}");
    // The written study is the same study.
    let again = quick::load(&out.join("resolved.toml"), &[]);
    let names: Vec<&str> = again.parameters.iter().map(|p| p.name.as_str()).collect();
    let members = ["T24", "T26", "T27", "T28"].map(|name| format!("stiffness[{name}]"));
    let rest = ["stiffness.median", "stiffness.sd", "rate"].map(str::to_owned);
    assert_eq!(names, members.into_iter().chain(rest).collect::<Vec<_>>());
    // Other data: nothing is simulated or trained again.
    fs::write(folder.path().join("strain.csv"), measured(2)).unwrap();
    let ran = run(folder.path(), &[]);
    assert!(
        !ran.made.iter().any(|stage| stage == "simulate" || stage == "surrogate"),
        "{:?}",
        ran.made
    );
}

/// With its numerical error, which is known exactly here, a coarse model has the posterior of the fine one in each group;
/// without, that of another model.
#[test]
fn the_numerical_error_is_that_of_the_model_in_each_group() {
    let fine = "observe = \"exp(-rate * t) / stiffness\"";
    let coarse = "observe = \"exp(-rate * t) / stiffness + 0.1 * rate * t\"";
    let study = STUDY.replace(fine, coarse);
    assert_ne!(study, STUDY);
    let error = format!("[numerical_error]\nruns = 20\norder = 60\nmodel = {{ {fine} }}\n");
    let found = |text: &str| -> Vec<[f64; 2]> {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("study.toml"), text).unwrap();
        fs::write(folder.path().join("strain.csv"), measured(1)).unwrap();
        run(folder.path(), &[]);
        let summary = quick::summary(&folder.path().join("out"));
        let member = |(name, _)| &summary["parameters"][format!("stiffness[{name}]")];
        let law = |target| ["/mean", "/sd"].map(|key| number(member(target), key));
        STIFFNESS.into_iter().map(law).collect()
    };
    let exact = found(STUDY);
    let off = |other: Vec<[f64; 2]>| -> Vec<f64> {
        let each = exact.iter().zip(other);
        each.map(|(exact, other)| (other[0] - exact[0]).abs() / exact[1]).collect()
    };
    // Some sixty independent draws in each: the difference of two means has a Monte Carlo error of 0.18 standard deviations.
    let with = off(found(&format!("{study}\n{error}")));
    assert!(with.iter().all(|off| *off < 4.0 * 0.18), "{with:?}");
    let without = off(found(&study));
    assert!(without.iter().any(|off| *off > 2.0), "{without:?}");
}
