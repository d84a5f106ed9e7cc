//! Planted truths: straight lines with normal noise, whose posterior, evidence and predictions have closed forms. The
//! generator shares no code with the engine.

use std::fs;
use std::path::Path;

use generator::{line, noise};
use lacuna::report::summary;
use lacuna::run::{RunDirectory, Silent};
use lacuna::stage;
use rayon::prelude::*;
use serde_json::Value;

use crate::quick::{load, root};

/// The standard deviation of the noise.
pub const SD: f64 = 0.5;
/// Replicates of a case.
const REPLICATES: usize = 4;

/// What a run said of a truth, with the truth.
pub struct Case {
    /// The level and the rise.
    pub truth: [f64; 2],
    /// The exact posterior.
    pub exact: line::Posterior,
    /// A replicate that the run has not seen.
    pub new: Vec<f64>,
    /// `summary.json`.
    pub summary: Value,
    /// The band of a new replicate: lower and upper ends.
    pub band: (Vec<f64>, Vec<f64>),
    /// The expected log density of data like the measured ones under the exact prediction from the measured ones, at the truth.
    pub elpd: f64,
}

/// Draws truths from the priors and runs the study on data of each.
pub fn cases(count: usize, seed: u64) -> Vec<Case> {
    (0..count).into_par_iter().map(|k| case(seed + k as u64)).collect()
}

fn case(seed: u64) -> Case {
    let mut random = noise::Source::new(seed);
    let truth = line::PRIOR.map(|sd| sd * random.normal());
    let data = line::replicates(truth, SD, REPLICATES, &mut random);
    let new = line::replicates(truth, SD, 1, &mut random).remove(0);
    let exact = line::posterior(&data, SD);
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &data, &mut random);
    let study =
        load(&folder.path().join("study.toml"), &[&format!("study.seed={}", seed % 100_000)]);
    let mut run = RunDirectory::open(&folder.path().join("out")).unwrap();
    let findings = stage::run(&study, &mut run, &Silent).unwrap();
    let band = findings.validation.as_ref().and_then(|v| v.predictive.clone()).unwrap();
    Case { truth, exact, new, summary: summary(&findings), band, elpd: elpd(truth, &exact) }
}

/// The study with its measurements, and runs at points of the priors.
fn write(folder: &Path, data: &[Vec<f64>], random: &mut noise::Source) {
    fs::copy(root().join("tests/gate/study.toml"), folder.join("study.toml")).unwrap();
    fs::write(folder.join("line.csv"), line::table(data)).unwrap();
    let [runs, responses] = line::runs(40, random);
    fs::write(folder.join("runs.csv"), runs).unwrap();
    fs::write(folder.join("responses.csv"), responses).unwrap();
}

/// The expected log predictive density of new data of the same size: at each time the prediction is normal.
fn elpd(truth: [f64; 2], exact: &line::Posterior) -> f64 {
    let [[a, b], [_, c]] = exact.covariance;
    let one = |t: &f64| {
        let variance = SD * SD + a + 2.0 * b * t + c * t * t;
        let off = exact.mean[0] + exact.mean[1] * t - truth[0] - truth[1] * t;
        -0.5 * ((std::f64::consts::TAU * variance).ln() + (SD * SD + off * off) / variance)
    };
    REPLICATES as f64 * line::TIMES.iter().map(one).sum::<f64>()
}
