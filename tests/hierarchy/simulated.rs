//! Simulation-based calibration (Talts and others, arXiv:1804.06788): truths drawn from the populations, data of each, and the
//! ranks of the truths among the draws, which are uniform for a correct posterior.

use std::fs;

use lacuna::diagnose::coverage::{Noise, Source, Word};

use super::schools;
use crate::coverage::verb::{asked, count};
use crate::quick::replace;

/// ```sh
/// cargo test -p lacuna-tests --test all -- --ignored --nocapture truths_of_populations_have_uniform_ranks
/// ```
#[test]
#[ignore = "180 calibrations take several minutes"]
fn truths_of_populations_have_uniform_ranks() {
    for population in [
        "normal = { mean = { normal = [0.0, 5.0] }, sd = { half_normal = 10.0 } }",
        "student_t = { degrees_of_freedom = 4.0, location = { normal = [0.0, 5.0] }, scale = { half_normal = 10.0 } }",
        "log_normal = { median = { log_normal = [3.0, 0.5] }, sd = { half_normal = 0.5 } }",
    ] {
        let folder = schools("");
        let path = folder.path().join("study.toml");
        let text = fs::read_to_string(&path).unwrap();
        let written = text.lines().find(|line| line.starts_with("population")).unwrap();
        replace(&path, written, &format!("population = {{ {population} }}"));
        let settings =
            ["sampler.steps=600", "sampler.warm_up=300", "sampler.target_acceptance=0.95"];
        let out = folder.path().join("out");
        let found = count(folder.path(), &out, &settings, &asked(60, Some(Noise::Prior))).unwrap();
        eprintln!("{population}: {}", found.tally.verdict.text);
        for row in &found.tally.rows {
            let shares: Vec<f64> = row.levels.iter().map(|level| level.share).collect();
            eprintln!("  {}: {shares:?}, uniform {:?}", row.name, row.uniform);
        }
        assert_eq!(found.source, Source::Model);
        assert_eq!(found.tally.verdict.word, Word::Nominal, "{}", found.tally.verdict.text);
    }
}
