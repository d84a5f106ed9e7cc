//! Known truths: straight lines with normal noise, whose posterior, evidence and predictions have closed forms. The
//! generator shares no code with the engine.

use std::fs;
use std::path::Path;

use generator::{line, noise};
use lacuna::run::Silent;
use lacuna_engine::pipeline;
use lacuna_run::RunDirectory;
use rayon::prelude::*;
use serde_json::Value;

use crate::quick::described::summary_of;
use crate::quick::{load, root};

/// The standard deviation of the noise.
pub const SD: f64 = 0.5;
/// Number of replicates of a case.
const REPLICATES: usize = 4;

/// Result of a run, with the truth.
pub struct Case {
    /// True level and slope.
    pub truth: [f64; 2],
    /// The exact posterior.
    pub exact: line::Posterior,
    /// A replicate that was not used in the run.
    pub new: Vec<f64>,
    /// Content of `summary.json`.
    pub summary: Value,
    /// Band of a new replicate: lower and upper ends.
    pub band: (Vec<f64>, Vec<f64>),
    /// Expected log density at the truth of data like the measured ones, under the exact prediction from the measured
    /// ones.
    pub elpd: f64,
}

/// Draws truths from the priors and runs the study on data for each.
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
    let findings = pipeline::run(&study, &mut run, &Silent).unwrap();
    let band = findings.validation.as_ref().and_then(|v| v.predictive.clone()).unwrap();
    Case { truth, exact, new, summary: summary_of(&findings), band, elpd: elpd(truth, &exact) }
}

/// Writes the study with its measurements, and runs at points drawn from the priors.
fn write(folder: &Path, data: &[Vec<f64>], random: &mut noise::Source) {
    fs::copy(root().join("tests/gate/study.toml"), folder.join("study.toml")).unwrap();
    fs::write(folder.join("line.csv"), line::table(data)).unwrap();
    let [runs, responses] = line::runs(40, random);
    fs::write(folder.join("runs.csv"), runs).unwrap();
    fs::write(folder.join("responses.csv"), responses).unwrap();
}

/// Expected log predictive density of new data of the same size: at each time the prediction is normal.
fn elpd(truth: [f64; 2], exact: &line::Posterior) -> f64 {
    let [[a, b], [_, c]] = exact.covariance;
    let one = |t: &f64| {
        let variance = SD * SD + a + 2.0 * b * t + c * t * t;
        let off = exact.mean[0] + exact.mean[1] * t - truth[0] - truth[1] * t;
        -0.5 * ((std::f64::consts::TAU * variance).ln() + (SD * SD + off * off) / variance)
    };
    REPLICATES as f64 * line::TIMES.iter().map(one).sum::<f64>()
}
