//! Cut distributions against the closed form of biased data (Liu, Bayarri and Berger, Bayesian Analysis 4 (2009) 119; with the
//! numbers of Jacob, Murray, Holmes and Robert, arXiv 1708.08719, section 4.1): `n = 100` values about `first`, which are the
//! prior here, and `n = 1000` values about `first + second`, where the prior of the bias `second` is too narrow.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::quick;

const STUDY: &str = r#"
[study]
name = "biased"
title = "Biased data"
seed = 5

[[parameter]]
name = "first"
prior = { normal = [0.0, 0.1] }
cut = true

[[parameter]]
name = "second"
prior = { normal = [0.0, 0.1] }

[response]
name = "y"
axes = { place = { values = [1], unit = "1" } }

[model]
use = "equations"
observe = "first + second"

[measurements]
use = "csv"
path = "y.csv"

[discrepancy]
use = "gaussian"
variance = { known = 0.001 }

[sampler]
use = "affine_invariant_ensemble"
walkers = 10
steps = 800

[validate]
rerun_model = false
"#;

/// Mean of the 1000 values; its variance is 0.001.
const MEAN: f64 = 1.02;

fn written(change: impl Fn(String) -> String) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), change(STUDY.to_owned())).unwrap();
    fs::write(folder.path().join("y.csv"), format!("place,y\n1,{MEAN}\n")).unwrap();
    folder
}

fn run(folder: &Path, settings: &[&str], out: &str) -> Value {
    let ran = quick::run(&folder.join("study.toml"), settings, &folder.join(out));
    quick::described::summary_of(&ran.unwrap_or_else(|stop| panic!("{stop}")).findings)
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {pointer}"))
}

/// Given `first`, the posterior of `second` is normal with the precision `1000 + 100`, and its mean is
/// `1000 (y - first) / 1100`. `first` keeps its prior, of standard deviation 0.1; the full posterior moves it to 0.486. The
/// tolerances are four Monte Carlo errors of the means and standard deviations of independent draws, as many as are stated.
#[test]
fn the_cut_distribution_of_biased_data_is_exact() {
    let (gain, own) = (1000.0 / 1100.0, 1.0 / 1100.0_f64);
    let sd = (own + gain * gain * 0.01).sqrt();
    for (name, settings) in [
        ("ensemble", &[][..]),
        ("no_u_turn", &["sampler.use=\"no_u_turn\"", "sampler.steps=300", "sampler.warm_up=150"]),
        ("smc", &["sampler.use=\"sequential_monte_carlo\"", "sampler.particles=100"]),
    ] {
        let folder = written(|text| text);
        let summary = run(folder.path(), settings, "out");
        for (parameter, mean, sd) in [("first", 0.0, 0.1), ("second", gain * MEAN, sd)] {
            let at = |key: &str| number(&summary, &format!("/parameters/{parameter}/{key}"));
            let draws = at("ess_bulk");
            assert!(draws > 400.0, "{name} {parameter}: {draws} effective draws");
            let off = at("mean") - mean;
            assert!(off.abs() < 4.0 * sd / draws.sqrt(), "{name} {parameter}: off by {off}");
            let ratio = at("sd") / sd;
            assert!(
                (ratio - 1.0).abs() < 4.0 / (2.0 * draws).sqrt(),
                "{name} {parameter}: {ratio}"
            );
        }
        let correlation = number(&summary, "/correlation/matrix/0/1");
        let expected = -gain * 0.1 / sd;
        assert!((correlation - expected).abs() < 0.02, "{name}: {correlation} {expected}");
        assert!(summary["evidence"].is_null());
    }
}

/// Without the cut the data move the parameter to the posterior mean, `y · 0.01 / (0.02 + 0.001)`.
#[test]
fn without_the_cut_the_data_move_the_parameter() {
    let folder = written(|text| text.replace("cut = true\n", ""));
    let summary = run(folder.path(), &["sampler.steps=2000"], "out");
    let at = |key: &str| number(&summary, &format!("/parameters/first/{key}"));
    let off = at("mean") - MEAN * 0.01 / 0.021;
    assert!(off.abs() < 4.0 * at("sd") / at("ess_bulk").sqrt(), "{off}");
}

/// Two cut parameters, each with half of the variance, of which only the sum matters.
#[test]
fn several_parameters_can_be_cut() {
    let both = "[[parameter]]\nname = \"more\"\nprior = { normal = [0.0, 0.0707106781] }\ncut = true\n\n[response]";
    let change = |text: String| {
        let narrower = text.replacen("[0.0, 0.1]", "[0.0, 0.0707106781]", 1);
        narrower.replace("first + second", "first + more + second").replace("[response]", both)
    };
    let folder = written(change);
    let summary = run(folder.path(), &["sampler.imputations=80"], "out");
    let gain = 1000.0 / 1100.0;
    let at = |key: &str| number(&summary, &format!("/parameters/second/{key}"));
    let off = at("mean") - gain * MEAN;
    let sd = (1.0 / 1100.0 + gain * gain * 0.01_f64).sqrt();
    assert!(off.abs() < 4.0 * sd / at("ess_bulk").sqrt(), "{off}");
    // The standard deviation is that of 80 values of a sum, with a relative error of 1 / √160.
    assert!((at("sd") / sd - 1.0).abs() < 4.0 / 160.0_f64.sqrt(), "{}", at("sd") / sd);
}
