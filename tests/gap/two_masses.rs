//! Two masses in a table of simulation runs, and measurements in which drag is hidden. The simulator has a spring that
//! hardens, and integrates by itself.

use std::fmt::Write as _;
use std::fs;

use generator::chain::Chain;
use generator::noise::Source;
use lacuna::run::Silent;
use lacuna_engine::gap::result::GapResult;
use lacuna_run::RunDirectory;
use tempfile::TempDir;

use super::inside::loaded;

pub const STUDY: &str = r#"
[study]
title = "two masses"
seed = 11

[[parameter]]
name = "k1"
prior = { uniform = [3.2, 4.8] }

[[parameter]]
name = "k2"
prior = { uniform = [1.6, 2.4] }

[[parameter]]
name = "c"
prior = { uniform = [0.3, 0.5] }

[response]
name = "y"
axes = { sensor = ["x1", "x2", "v1"], time = { first = 0.0, last = 9.9, count = 100, unit = "1" } }

[simulations]
use = "csv"
parameters = "runs.csv"
responses = "responses.csv"

[measurements]
use = "csv"
path = "data.csv"

[surrogate]
use = "polynomial_chaos"
degree = { max = 6 }

[discrepancy]
use = "gaussian"
variance = { half_normal = 0.01 }

[sampler]
use = "affine_invariant_ensemble"
walkers = 16
steps = 100

[gap]
simulations = 99
"#;

/// The stiffness that grows with the deflection: the simulator has it, the companion does not.
pub const HARDENING: f64 = 0.1;
pub const DRAG: f64 = 0.25;
pub const TRUTH: [f64; 4] = [4.1, 1.95, 0.41, 1.0];
const RUNS: usize = 80;
const REPLICATES: usize = 8;

/// The curves of `x1`, `x2` and `v1` at 100 times.
pub fn curves(parameters: [f64; 4], drag: f64) -> Vec<Vec<f64>> {
    let chain = Chain { cubic: HARDENING, drag, ..Chain::plain(parameters) };
    generator::sampled(&chain.curves(0)).into_iter().take(3).collect()
}

pub fn rows(csv: &mut String, first: &str, curves: &[Vec<f64>]) {
    for (sensor, curve) in ["x1", "x2", "v1"].iter().zip(curves) {
        for (i, y) in curve.iter().enumerate() {
            writeln!(csv, "{first},{sensor},{},{y}", 0.1 * i as f64).unwrap();
        }
    }
}

/// The folder of a study with a table of runs and measurements in which drag is hidden.
pub fn folder(drag: f64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Source::new(3);
    let mut runs = "run,k1,k2,c\n".to_owned();
    let mut responses = "run,sensor,time,y\n".to_owned();
    for run in 0..RUNS {
        let [k1, k2, c] =
            [[3.2, 4.8], [1.6, 2.4], [0.3, 0.5]].map(|[low, high]| random.uniform(low, high));
        writeln!(runs, "{run},{k1},{k2},{c}").unwrap();
        rows(&mut responses, &run.to_string(), &curves([k1, k2, c, 1.0], 0.0));
    }
    let truth = curves(TRUTH, drag);
    let mut data = "replicate,sensor,time,y\n".to_owned();
    for replicate in 0..REPLICATES {
        let noisy: Vec<Vec<f64>> = truth
            .iter()
            .map(|curve| curve.iter().map(|y| y + 0.02 * random.normal()).collect())
            .collect();
        rows(&mut data, &replicate.to_string(), &noisy);
    }
    for (name, text) in [("runs.csv", runs), ("responses.csv", responses), ("data.csv", data)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

pub fn searched(folder: &TempDir, text: &str) -> GapResult {
    let study = loaded(folder, text);
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let findings = lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent).unwrap();
    findings.gap.unwrap().result
}
