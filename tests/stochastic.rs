//! Models whose response is random: the pseudo-marginal posterior against closed forms, and where its assumptions fail.
//!
//! The model is `location + u` with one uniform number `u` per run, made from its seed, and normal noise. With the mean of
//! `n` values `m`, the likelihood of a replicate is a difference of two normal distribution functions of width `s / √n`.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use lacuna::math::special::normal_cdf;
use lacuna_engine::assess::Finding;
use lacuna_engine::report::findings::Findings;
use tempfile::TempDir;

use crate::quick;

const STUDY: &str = r#"
[study]
name = "random"
title = "A uniform effect and normal noise"
seed = 11

[[parameter]]
name = "location"
prior = { uniform = [-2.0, 2.0] }

[response]
name = "y"
axes = { place = { values = [1, 2], unit = "1" } }

[model]
use = "equations"
seed = "seed"
observe = "location + 2 * (seed / 2147483648 - 0.5)"

[measurements]
use = "csv"
path = "y.csv"

[discrepancy]
use = "pseudo_marginal"
simulations = 5
variance = { known = 0.25 }

[sampler]
use = "adaptive_metropolis"
steps = 6000
warm_up = 100

[validate]
rerun_model = false
"#;

const WIDTH: f64 = 2.0;
const SD: f64 = 0.5;
/// Values at the two places in each replicate.
const VALUES: [[f64; 2]; 4] = [[0.9, 1.2], [-0.4, -0.1], [0.3, 0.8], [0.2, -0.3]];

fn written(change: impl Fn(String) -> String) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), change(STUDY.to_owned())).unwrap();
    let mut table = "replicate,place,y\n".to_owned();
    for (replicate, [a, b]) in VALUES.iter().enumerate() {
        table.push_str(&format!("{replicate},1,{a}\n{replicate},2,{b}\n"));
    }
    fs::write(folder.path().join("y.csv"), table).unwrap();
    folder
}

fn run(folder: &Path, settings: &[&str], out: &str) -> Findings {
    let ran = quick::run(&folder.join("study.toml"), settings, &folder.join(out));
    ran.unwrap_or_else(|stop| panic!("{stop}")).findings
}

/// Log-likelihood of all replicates.
fn log_likelihood(location: f64) -> f64 {
    let one = |values: &[f64; 2]| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|y| (y - mean).powi(2)).sum();
        let own = SD / n.sqrt();
        let at = |edge: f64| normal_cdf((mean - location + edge) / own);
        let marginal = (at(0.5 * WIDTH) - at(-0.5 * WIDTH)) / WIDTH;
        let rest = -0.5 * n * (TAU * SD * SD).ln() - squares / (2.0 * SD * SD);
        marginal.ln() + rest + 0.5 * (TAU * own * own).ln()
    };
    VALUES.iter().map(one).sum()
}

/// Mean, standard deviation and log evidence by the midpoint rule under the uniform prior from -2 to 2.
fn exact() -> (f64, f64, f64) {
    const POINTS: usize = 40_000;
    let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
    for k in 0..POINTS {
        let x = -2.0 + 4.0 * (k as f64 + 0.5) / POINTS as f64;
        let weight = log_likelihood(x).exp() / POINTS as f64;
        total += weight;
        first += weight * x;
        second += weight * x * x;
    }
    let mean = first / total;
    (mean, (second / total - mean * mean).sqrt(), total.ln())
}

fn of_code<'a>(findings: &'a Findings, code: &str) -> Vec<&'a Finding> {
    findings.assessment.findings.iter().filter(|finding| finding.code == code).collect()
}

/// Mean and standard deviation within four Monte Carlo errors, with a random walk and with an ensemble.
#[test]
fn the_posterior_of_a_random_effect_is_exact() {
    let (mean, sd, _) = exact();
    for sampler in
        ["sampler.use=\"adaptive_metropolis\"", "sampler.use=\"affine_invariant_ensemble\""]
    {
        let steps =
            if sampler.contains("ensemble") { "sampler.steps=450" } else { "sampler.steps=2500" };
        let folder = written(|text| text);
        let findings = run(folder.path(), &[sampler, steps], "out");
        let found = &quick::described::summary_of(&findings)["parameters"]["location"];
        let number = |key: &str| found[key].as_f64().unwrap();
        let draws = number("ess_bulk");
        let error = sd / draws.sqrt();
        assert!(draws > 400.0, "{sampler}: {draws}");
        assert!(
            (number("mean") - mean).abs() < 4.0 * error,
            "{sampler}: {} {mean} +- {error}",
            number("mean")
        );
        let ratio = number("sd") / sd;
        assert!((ratio - 1.0).abs() < 4.0 / (2.0 * draws).sqrt(), "{sampler}: {ratio} {draws}");
        assert!(of_code(&findings, "likelihood_estimate").is_empty());
    }
}

/// The estimate of the evidence by sequential Monte Carlo is that of the exact likelihood; other samplers give none.
#[test]
fn the_evidence_of_a_random_effect_is_found() {
    let folder = written(|text| text);
    let settings = ["sampler.use=\"sequential_monte_carlo\"", "sampler.particles=500"];
    let findings = run(folder.path(), &settings, "out");
    let summary = quick::described::summary_of(&findings);
    let number = |key: &str| summary["evidence"][key].as_f64().unwrap();
    let off = number("log") - exact().2;
    assert!(off.abs() < 4.0 * number("error"), "{off} {}", number("error"));
    let chains = run(folder.path(), &["sampler.steps=500"], "chains");
    let summary = quick::described::summary_of(&chains);
    assert!(summary["evidence"].is_null(), "{}", summary["evidence"]);
}

/// One run per replicate of a model whose noise is small: the report states the variance and the number of runs that
/// would be better. A model without a random number is found out, and so is one that ignores its seed.
#[test]
fn too_few_runs_and_models_that_are_not_random_are_reported() {
    let folder = written(|text| text.replace("simulations = 5", "simulations = 1"));
    let settings = ["discrepancy.variance={ known = 1e-3 }", "sampler.steps=1000"];
    let findings = run(folder.path(), &settings, "few");
    let found = of_code(&findings, "likelihood_estimate");
    assert!(found[0].figure.is_none_or(|variance| variance > 3.0), "{found:?}");
    assert!(!of_code(&findings, "sticking_chain").is_empty());
    let folder = written(|text| text.replace("2 * (seed", "0 * (seed"));
    let findings = run(folder.path(), &["sampler.steps=500"], "fixed");
    assert_eq!(of_code(&findings, "deterministic_model").len(), 1);
    let python = "use = \"python\"\nfile = \"coin.py\"\nfunction = \"coin\"\nseed = \"seed\"";
    let own = |text: String| {
        let from = text.find("use = \"equations\"").unwrap();
        let to = text.find("[measurements]").unwrap();
        format!("{}{python}\n\n{}", &text[..from], &text[to..])
    };
    let folder = written(own);
    let text = "import random\n\n\ndef coin(location, seed):\n    return [location + random.random()] * 2\n";
    fs::write(folder.path().join("coin.py"), text).unwrap();
    let stop = quick::run(&folder.path().join("study.toml"), &[], &folder.path().join("out"));
    let stop = stop.err().map(|stop| stop.to_string()).unwrap_or_default();
    assert!(stop.contains("different responses to the same inputs and the same seed"), "{stop}");
}

/// The draws are the same to the last bit with one thread and with four, and others with another seed of the study.
#[test]
fn the_draws_depend_on_the_seed_of_the_study_only() {
    let folder = written(|text| text);
    let draws = |threads: usize, out: &str, seed: &str| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = ["sampler.steps=300", seed];
        pool.install(|| run(folder.path(), &settings, out));
        let all = quick::results(&folder.path().join(out)).into_iter();
        all.filter(|(path, _)| path.starts_with("5-calibrate")).collect::<Vec<_>>()
    };
    let first = draws(1, "one", "study.seed=1");
    assert_eq!(first, draws(4, "four", "study.seed=1"));
    assert_ne!(first, draws(1, "other", "study.seed=2"));
}

/// With a surrogate each run of the design has a seed of its own: the runs scatter about the surrogate with the standard
/// deviation of the uniform number, `2 / √12`, known from 200 runs to within 3 %.
#[test]
fn a_surrogate_learns_the_mean_of_a_stochastic_model() {
    let other = "[design]\nuse = \"latin_hypercube\"\nruns = 200\n\n[surrogate]\nuse = \"polynomial_chaos\"\ndegree = 1\n\n\
                 [discrepancy]\nuse = \"gaussian\"\nvariance = { known = 0.09 }\n\n[sampler]";
    let folder = written(|text| {
        let (from, to) = (text.find("[discrepancy]").unwrap(), text.find("[sampler]").unwrap());
        format!("{}{other}{}", &text[..from], &text[to + "[sampler]".len()..])
    });
    let findings = run(folder.path(), &["sampler.steps=500"], "out");
    let summary = quick::described::summary_of(&findings);
    let rmse = summary["surrogate"]["rmse"].as_f64().unwrap();
    let expected = WIDTH / 12.0_f64.sqrt();
    assert!((rmse / expected - 1.0).abs() < 0.12, "{rmse} {expected}");
}
