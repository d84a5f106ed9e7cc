//! The stated start of the search for the best fit: a wave over many periods, whose frequency the data know to one part in
//! 115,000, so that among the draws of the prior none is near.
//!
//! The model is the truth, `sin(f t)`: what is tested is the search.

use std::fmt::Write as _;
use std::fs;

use generator::noise;

use crate::quick;

const FREQUENCY: f64 = 31.4;
const POINTS: usize = 500;
const LENGTH: f64 = 40.0;
const NOISE: f64 = 0.1;

const STUDY: &str = r#"
[study]
title = "a wave"
seed = 3

[[parameter]]
name = "f"
unit = "1/s"
prior = { uniform = [5.0, 100.0] }

[response]
name = "x"
unit = "m"
axes = { t = { measured = true, unit = "s" } }

[model]
use = "equations"
observe = "sin(f * t) * 1 {m}"

[measurements]
use = "csv"
path = "data.csv"

[discrepancy]
use = "gaussian"
variance = { half_normal = 1.0 }

[sampler]
use = "no_u_turn"
warm_up = 20
steps = 40
chains = 2
"#;

/// The MAP of the frequency with further sections of the study.
fn map(more: &str) -> f64 {
    let mut random = noise::Source::new(8);
    let mut table = "t [s],x [m]\n".to_owned();
    for i in 1..=POINTS {
        let t = LENGTH * i as f64 / POINTS as f64;
        writeln!(table, "{t},{}", (FREQUENCY * t).sin() + NOISE * random.normal()).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("data.csv"), table).unwrap();
    fs::write(folder.path().join("study.toml"), STUDY.to_owned() + more).unwrap();
    let path = folder.path().join("study.toml");
    let out = folder.path().join("out");
    quick::run(&path, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    let summary = fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    summary.pointer("/parameters/f/map").and_then(serde_json::Value::as_f64).unwrap()
}

/// The Cramér-Rao bound of the variance of a frequency with known phase and amplitude one is `6 noise^2 / (n T^2)` (Rife and
/// Boorstyn, IEEE Trans. Inf. Theory 20 (1974) 591).
#[test]
fn a_stated_start_leads_to_the_mode_that_draws_of_the_prior_miss() {
    let sd = (6.0 / POINTS as f64).sqrt() * NOISE / LENGTH;
    assert!(95.0 / sd > 1e5, "the case is too easy");
    let without = map("");
    assert!((without - FREQUENCY).abs() > 100.0 * sd, "the case is too easy: {without}");
    let with = map("\n[[start]]\nname = \"f\"\nvalue = 31.38\n");
    assert!((with - FREQUENCY).abs() < 4.0 * sd, "{with} ± {sd}");
}
