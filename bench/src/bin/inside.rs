//! Time of the search inside equations against the number of points: `cargo run --release -p lacuna-bench --bin inside --
//! [FOLDER]`, and then `python bench/peers/inside_scipy.py [FOLDER]`, which fits the true model alone to the same records.
//!
//! A driven oscillator with five unknowns lacks a cubic stiffness. Its record is integrated here by the classical
//! Runge-Kutta method with ten steps a point. `lacuna gap` without the calibrations before and after is measured: the
//! search among all terms and effects, and the proof. The default folder is `target/bench-inside`.

use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use generator::noise::Source;
use lacuna::run::Silent;
use lacuna_bench::clock::timed;
use lacuna_engine::study::resolve::load_text;
use lacuna_plugins as _;
use lacuna_run::RunDirectory;

/// Numbers of points of the records.
const POINTS: [usize; 3] = [300, 1000, 3000];

/// Time between points, in s, and integration steps between them.
const STEP: f64 = 0.05;
const STEPS: usize = 10;

/// Standard deviation of the noise, in m.
const NOISE: f64 = 0.005;

/// Stiffness, damping, gain of the force, the cubic stiffness that is missing, and position and speed at the start.
const TRUTH: [f64; 6] = [9.0, 0.25, 4.0, 6.0, 0.3, 0.0];

const STUDY: &str = r#"
[study]
title = "a driven oscillator"
seed = 3

[[parameter]]
name = "stiffness"
unit = "1/s2"
prior = { log_uniform = [3.0, 30.0] }

[[parameter]]
name = "damping"
unit = "1/s"
prior = { log_uniform = [0.03, 3.0] }

[[parameter]]
name = "gain"
unit = "m/s2"
prior = { log_uniform = [0.5, 50.0] }

[[parameter]]
name = "begin"
unit = "m"
prior = { normal = [0.3, 0.1] }

[[parameter]]
name = "speed"
unit = "m/s"
prior = { normal = [0.0, 0.2] }

[response]
name = "x"
unit = "m"
axes = { t = { measured = true, unit = "s" } }

[model]
use = "equations"
state = { x = { start = "begin", unit = "m" }, v = { start = "speed", unit = "m/s" } }
observe = "x"

[model.rate]
x = "v"
v = "gain * (sin(2 * pi * 0.37 {1/s} * t) + sin(2 * pi * 0.61 {1/s} * t)) - stiffness * x - damping * v"

[measurements]
use = "csv"
path = "data.csv"
noise = { sd = 0.005, memory = 0 }

[discrepancy]
use = "gaussian"
variance = { half_normal = 0.1 }

[sampler]
use = "no_u_turn"
warm_up = 20
steps = 40

[gap]
laws = false
"#;

fn main() -> Result<(), Box<dyn Error>> {
    let folder =
        std::env::args().nth(1).map_or_else(|| PathBuf::from("target/bench-inside"), PathBuf::from);
    println!("points\tseconds\tprocessor seconds\tverdict\tnames");
    for count in POINTS {
        let own = folder.join(count.to_string());
        fs::create_dir_all(&own)?;
        fs::write(own.join("data.csv"), table(count)?)?;
        println!("{}", searched(&own, count)?);
    }
    Ok(())
}

/// The search and the proof, as a line of the table.
fn searched(folder: &Path, count: usize) -> Result<String, Box<dyn Error>> {
    let checked = load_text(&folder.join("study.toml"), STUDY, &[]);
    let complaints = checked.complaints();
    let study = checked.study.ok_or(complaints)?;
    let out = folder.join("run");
    if out.exists() {
        fs::remove_dir_all(&out)?;
    }
    let mut run = RunDirectory::open(&out)?;
    let begun = Instant::now();
    let (found, processor) =
        timed(|| lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent))?;
    let seconds = begun.elapsed().as_secs_f64();
    let result = found?.gap.ok_or("the study has no gap")?.result;
    let names: Vec<&str> = result.additions.iter().map(|a| a.kind.as_str()).collect();
    let (word, names) = (result.verdict.word, names.join(" + "));
    Ok(format!("{count}\t{seconds:.1}\t{processor:.1}\t{word:?}\t{names}"))
}

/// The acceleration, in m/s².
fn acceleration(x: f64, v: f64, t: f64) -> f64 {
    let [stiffness, damping, gain, cubic, ..] = TRUTH;
    let force = (TAU * 0.37 * t).sin() + (TAU * 0.61 * t).sin();
    gain * force - stiffness * x - damping * v - cubic * x.powi(3)
}

/// The record as a table.
fn table(count: usize) -> Result<String, std::fmt::Error> {
    let mut random = Source::new(11);
    let h = STEP / STEPS as f64;
    let (mut x, mut v) = (TRUTH[4], TRUTH[5]);
    let mut text = "replicate,t [s],x [m]\n".to_owned();
    for k in 0..count * STEPS {
        let t = k as f64 * h;
        let (x1, v1) = (v, acceleration(x, v, t));
        let (x2, v2) =
            (v + 0.5 * h * v1, acceleration(x + 0.5 * h * x1, v + 0.5 * h * v1, t + 0.5 * h));
        let (x3, v3) =
            (v + 0.5 * h * v2, acceleration(x + 0.5 * h * x2, v + 0.5 * h * v2, t + 0.5 * h));
        let (x4, v4) = (v + h * v3, acceleration(x + h * x3, v + h * v3, t + h));
        x += h / 6.0 * (x1 + 2.0 * x2 + 2.0 * x3 + x4);
        v += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
        if (k + 1) % STEPS == 0 {
            writeln!(text, "0,{:.2},{:.9}", (k + 1) as f64 * h, x + NOISE * random.normal())?;
        }
    }
    Ok(text)
}
