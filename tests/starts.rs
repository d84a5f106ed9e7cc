//! The stated start of the search for the best fit: a wave over many periods, whose frequency the data know to one part in
//! 115,000, so that among the draws of the prior none is near.
//!
//! The model is the truth, `sin(f t)`: what is tested is the search.

use std::fs;

use crate::quick;

const FREQUENCY: f64 = 31.4;
const POINTS: usize = 500;
const LENGTH: f64 = 40.0;
const NOISE: f64 = 0.1;

/// The MAP of the frequency with further sections of the study.
fn map(more: &str) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let parameter = "name = \"f\"\nunit = \"1/s\"\nprior = { uniform = [5.0, 100.0] }";
    let model = "observe = \"sin(f * t) * 1 {m}\"";
    let sampler = format!("use = \"no_u_turn\"\nwarm_up = 20\nsteps = 40\nchains = 2\n{more}");
    let sections = [parameter, model, &sampler];
    quick::oscillation(folder.path(), sections, (POINTS, LENGTH), |t| (FREQUENCY * t).sin());
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
