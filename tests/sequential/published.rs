//! Test problems of Sürer, Plumlee and Wild, Technometrics 66 (2024) 162, and their posteriors on a grid.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use lacuna::run::Silent;
use lacuna_engine::pipeline;
use lacuna_run::RunDirectory;
use tempfile::TempDir;

use crate::quick;

/// A problem with two parameters, uniform priors and normal noise of known variance.
pub struct Problem {
    pub name: &'static str,
    pub bounds: [[f64; 2]; 2],
    /// Responses as formulas of `a` and `b`.
    formulas: &'static [&'static str],
    /// The same responses.
    pub model: fn([f64; 2]) -> Vec<f64>,
    pub data: &'static [f64],
    pub variance: &'static [f64],
}

pub const BANANA: Problem = Problem {
    name: "banana",
    bounds: [[-20.0, 20.0], [-10.0, 5.0]],
    formulas: &["a", "b + 0.03 * a^2"],
    model: |[a, b]| vec![a, b + 0.03 * a * a],
    data: &[1.0, 3.0],
    variance: &[100.0, 1.0],
};

/// The variances are `1 / sqrt(0.2)` and `1 / sqrt(0.75)`.
pub const BIMODAL: Problem = Problem {
    name: "bimodal",
    bounds: [[-6.0, 6.0], [-4.0, 8.0]],
    formulas: &["b - a^2", "b - a"],
    model: |[a, b]| vec![b - a * a, b - a],
    data: &[0.0, 2.0],
    variance: &[2.236_067_977_499_79, 1.154_700_538_379_251_5],
};

pub const UNIMODAL: Problem = Problem {
    name: "unimodal",
    bounds: [[-4.0, 4.0], [-4.0, 4.0]],
    formulas: &["a^2 + a * b + b^2"],
    model: |[a, b]| vec![a * a + a * b + b * b],
    data: &[-6.0],
    variance: &[4.0],
};

impl Problem {
    /// A folder with the study of the problem, with responses in units of their noise.
    pub fn study(&self) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        let mut measured = "replicate,part,y [1]\n".to_owned();
        let mut observe = String::new();
        for (i, formula) in self.formulas.iter().enumerate() {
            let sd = self.variance[i].sqrt();
            writeln!(measured, "1,p{i},{:e}", self.data[i] / sd).unwrap();
            writeln!(observe, "p{i} = \"({formula}) / {sd:e}\"").unwrap();
        }
        fs::write(folder.path().join("measured.csv"), measured).unwrap();
        let labels: Vec<String> = (0..self.data.len()).map(|i| format!("\"p{i}\"")).collect();
        let [[a0, a1], [b0, b1]] = self.bounds;
        let text = format!(
            "[study]\ntitle = \"{}\"\nseed = 2024\n\
             [[parameter]]\nname = \"a\"\nprior = {{ uniform = [{a0:?}, {a1:?}] }}\n\
             [[parameter]]\nname = \"b\"\nprior = {{ uniform = [{b0:?}, {b1:?}] }}\n\
             [response]\nname = \"y\"\nunit = \"1\"\naxes = {{ part = [{}] }}\n\
             [model]\nuse = \"equations\"\n[model.observe]\n{observe}\
             [design]\nuse = \"latin_hypercube\"\nruns = 30\n\
             [measurements]\nuse = \"csv\"\npath = \"measured.csv\"\n\
             [surrogate]\nuse = \"gaussian_process\"\n\
             [discrepancy]\nuse = \"gaussian\"\nvariance = {{ known = 1.0 }}\n\
             [sampler]\nuse = \"sequential_monte_carlo\"\nparticles = 2000\n",
            self.name,
            labels.join(", "),
        );
        fs::write(folder.path().join("study.toml"), text).unwrap();
        folder
    }

    /// Mean and standard deviation of each parameter, by the midpoint rule on a grid of 800 x 800 cells.
    pub fn posterior(&self) -> [(f64, f64); 2] {
        const CELLS: usize = 800;
        let (mut total, mut sums, mut squares) = (0.0, [0.0; 2], [0.0; 2]);
        let at = |k: usize, i: usize| {
            let [low, high] = self.bounds[k];
            low + (high - low) * (i as f64 + 0.5) / CELLS as f64
        };
        for i in 0..CELLS {
            for j in 0..CELLS {
                let point = [at(0, i), at(1, j)];
                let response = (self.model)(point);
                let parts = response.iter().zip(self.data).zip(self.variance);
                let square: f64 = parts.map(|((f, y), v)| (f - y).powi(2) / v).sum();
                let weight = (-0.5 * square).exp();
                total += weight;
                for k in 0..2 {
                    sums[k] += weight * point[k];
                    squares[k] += weight * point[k] * point[k];
                }
            }
        }
        [0, 1].map(|k| {
            let mean = sums[k] / total;
            (mean, (squares[k] / total - mean * mean).sqrt())
        })
    }
}

/// Draws of each parameter, and the number of runs made.
pub fn draws(path: &Path, settings: &[&str], out: &Path) -> (Vec<Vec<f64>>, usize) {
    let study = quick::load(path, settings);
    let mut run = RunDirectory::open(out).unwrap();
    let (emulated, kept) = pipeline::calibrate_emulated(&study, &mut run, &Silent).unwrap();
    let calibrated = kept.unwrap().value;
    let draws = calibrated.draws.from_step(calibrated.outcome.burn_in);
    let runs = emulated.data().value.runs().unwrap();
    let columns = (0..study.parameters.len()).map(|j| draws.pooled(j)).collect();
    (columns, runs.runs.len() + runs.failed.len())
}

pub const KALMAN: [&str; 3] = [
    "design={ use = \"ensemble_kalman\", runs = 10 }",
    "surrogate.use=gaussian_process",
    "surrogate.refine={ runs = 5, rounds = 4, until = 0.1, choose = \"posterior_variance\" }",
];

/// The banana, whose posterior fills a curved band of its box. An error of the response of `until` of the noise in each
/// of the two data moves a least-squares estimate by at most `sqrt(2) until` posterior standard deviations; the mean of
/// 2000 particles, half of which count as independent, adds 4 Monte Carlo errors.
#[test]
fn few_runs_find_the_posterior_of_a_banana() {
    let folder = BANANA.study();
    let (path, out) = (folder.path().join("study.toml"), folder.path().join("out"));
    let (columns, runs) = draws(&path, &KALMAN, &out);
    assert!(runs <= 90, "{runs} runs");
    for (k, (mean, sd)) in BANANA.posterior().into_iter().enumerate() {
        let found = lacuna::math::moments::mean(&columns[k]);
        let off = (found - mean).abs() / sd;
        let allowed = 0.1 * 2.0_f64.sqrt() + 4.0 / 1000.0_f64.sqrt();
        assert!(off < allowed, "parameter {k}: {found}, {mean} +- {sd}, {runs} runs");
    }
}
