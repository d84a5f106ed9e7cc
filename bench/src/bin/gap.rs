//! Speed of the gap workflow: `cargo run --release -p lacuna-bench --bin gap [-- TIMES]`.
//!
//! A case of the founding study's size: ten sensors with a hundred times, or as many as are asked, twenty replicates, three parameters, a
//! polynomial chaos expansion whose error is of low rank, and an echo hidden on one sensor. All effects of the library
//! are candidates. Prints wall time and processor time of each stage; quote them together with the load of the machine.

use std::error::Error;
use std::sync::OnceLock;
use std::time::Instant;

use lacuna::data::{Axis, Layout, Layouts, Measurements, Observations, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna::plugin::effect::Situation;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Design, Emulator, Surrogate, registry};
use lacuna::run::{Progress, Silent};
use lacuna_bench::clock::timed;
use lacuna_engine::gap::candidates::proposed;
use lacuna_engine::gap::experiment::Experiment;
use lacuna_engine::gap::noise::{Noise, ResponseTangents};
use lacuna_engine::gap::prove::{freedoms, prove};
use lacuna_engine::gap::search::{SearchOptions, search, verdict};
use lacuna_engine::gap::system::whitener::condensed;
use lacuna_linalg::Matrix;
use lacuna_plugins as _;

const SENSORS: usize = 10;

/// Number of times of each sensor, over ten seconds.
fn times() -> usize {
    static ASKED: OnceLock<usize> = OnceLock::new();
    *ASKED.get_or_init(|| std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(100))
}

/// Time of a number, in seconds.
fn time(i: usize) -> f64 {
    10.0 * i as f64 / times() as f64
}

const REPLICATES: usize = 20;
const HELD_OUT: usize = 5;
const RUNS: usize = 100;

/// Standard deviation of one replicate's noise; the responses are of order one.
const NOISE: f64 = 0.05;

fn main() -> Result<(), Box<dyn Error>> {
    let (layouts, parameters) = (layouts()?, parameters());
    let (emulator, error) = stage("emulator, given", || emulator(&layouts, &parameters))??;
    let train = measured(&layouts, 0..REPLICATES);
    let held_out = measured(&layouts, REPLICATES..REPLICATES + HELD_OUT);
    let mut experiment = Experiment::new(&layouts, &parameters, &*emulator, &train);
    experiment.common = vec![error];
    let centre = vec![0.5; 3];
    let response = emulator.mean(&Matrix::from_rows(3, [&centre])).row(0).to_vec();
    let whole = Instant::now();
    let noise =
        stage("noise", || Noise::of(&experiment, &ResponseTangents::fixed(&response), None))?;
    experiment.common =
        stage("common errors condensed", || condensed(&experiment, &noise, &response))?;
    println!("  directions of the common error: {}", experiment.common[0].factor.columns());
    let sd = noise.sd(&experiment, &response);
    let situation = Situation { layouts: &layouts, response: &response, noise: &sd };
    let candidates = stage("candidates", || proposed(None, &[], &situation))??.candidates;
    println!("  candidates: {}", candidates.len());
    for (what, most) in [("a look, without adding", 0), ("search: look, add, look again", 3)] {
        let options = SearchOptions { naming: 0.03, unlisted: 0.02, simulations: 199, most };
        let starts = [centre.clone()];
        let stream = Stream::root(1);
        let found = stage(what, || search(&experiment, &candidates, &starts, options, &stream))?
            .ok_or("the emulator has no answer")?;
        let verdict = verdict(&found, &candidates, options);
        println!("  {:?}", verdict.word);
        for e in &verdict.effects {
            println!(
                "  {} on {:?}: {:?}, probability {:.2}",
                e.kind, e.on, e.values, e.probability
            );
        }
        if let Some(first) = found.path.first() {
            let mut new = Experiment::new(&layouts, &parameters, &*emulator, &held_out);
            new.common.clone_from(&experiment.common);
            let (before, after) = (&first.before.fit.at.response, &found.last.fit.at.response);
            let proof = stage("proof", || {
                prove(&new, &found.noise, &freedoms(&experiment), before, after)
            })?;
            println!("  {:?}", proof.map(|proof| proof.all));
        }
    }
    println!("all but the emulator: {:.1} s", whole.elapsed().as_secs_f64());
    Ok(())
}

/// Runs a stage and prints its times.
fn stage<T>(what: &str, call: impl FnOnce() -> T) -> Result<T, Box<dyn Error>> {
    let begun = Instant::now();
    let (value, processor) = timed(call)?;
    let wall = begun.elapsed().as_secs_f64();
    println!("{what}: {wall:.2} s, {processor:.2} s of processor time");
    Ok(value)
}

fn layouts() -> Result<Layouts, Box<dyn Error>> {
    let times = (0..times()).map(time).collect();
    let labels: Vec<String> = (0..SENSORS).map(|s| format!("s{s}")).collect();
    let axes = vec![Axis::labels("sensor", labels), Axis::grid("time", times, Unit::parse("s")?)];
    Ok(Layout { name: "y".into(), unit: Unit::dimensionless(), axes }.into())
}

fn parameters() -> Vec<Parameter> {
    let parameter = |name: &str| Parameter {
        name: name.into(),
        symbol: name.into(),
        unit: Unit::dimensionless(),
        design: Distribution::Uniform([0.0, 1.0]),
        prior: Distribution::Uniform([0.0, 1.0]),
        reference: None,
    };
    vec![parameter("size"), parameter("speed"), parameter("loss")]
}

/// Waves that arrive at one sensor after another.
fn model(point: &[f64]) -> Vec<f64> {
    let [size, speed, loss] = [0.8 + 0.4 * point[0], 0.9 + 0.2 * point[1], 0.1 + 0.2 * point[2]];
    let value = |s: usize, t: f64| {
        let late = (t - 0.2 * s as f64 / speed).max(0.0);
        let wave = |k: f64| ((1.0 + k) * speed * late).sin() / (1.0 + k) * (-loss * late).exp();
        size * (wave(0.0) + wave(1.3 + 0.1 * s as f64) + 0.2 * (1.0 - (-late).exp()))
    };
    (0..SENSORS).flat_map(|s| (0..times()).map(move |t| value(s, time(t)))).collect()
}

/// A polynomial chaos expansion with its error, estimated by leaving runs out.
fn emulator(
    layouts: &Layouts,
    parameters: &[Parameter],
) -> Result<(Box<dyn Emulator>, CommonError), String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    let design = registry::from_text::<dyn Design>("latin_hypercube", "").map_err(|e| text(&e))?;
    let points = design.plugin.points(RUNS, 3, &Stream::root(2)).map_err(|e| text(&e))?;
    let responses = Matrix::from_rows(layouts.len(), points.iter_rows().map(model));
    let chaos = registry::from_text::<dyn Surrogate>("polynomial_chaos", "degree = { max = 6 }");
    let surrogate = chaos.map_err(|e| text(&e))?;
    let training =
        Training { parameters, layouts, points: &points, responses: &responses, gradients: None };
    let fitted = surrogate.plugin.fit(&training, &Stream::root(3), &Progress::new(&Silent));
    let emulator = fitted.map_err(|e| text(&e))?;
    let residuals = &emulator.fit_error().residuals;
    let scale = (RUNS as f64).sqrt();
    let factor = Matrix::from_fn(layouts.len(), RUNS, |i, r| residuals[(r, i)] / scale);
    Ok((
        emulator,
        CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true },
    ))
}

/// Replicates with autoregressive noise and an offset, for a truth with an echo on the fourth sensor.
fn measured(layouts: &Layouts, replicates: std::ops::Range<usize>) -> Observations {
    let mut truth = model(&[0.4, 0.6, 0.5]);
    let times = times();
    let (begin, lag) = (3 * times, 17 * times / 100);
    let plain = truth[begin..begin + times].to_vec();
    for t in lag..times {
        truth[begin + t] += 0.1 * plain[t - lag];
    }
    let replicate = |r: usize| {
        let mut rng = Stream::root(4).at(r as u64).generator();
        let noisy = truth.chunks(times).flat_map(|curve| {
            let offset = 0.3 * NOISE * normal(&mut rng);
            let mut noise = normal(&mut rng);
            let mut values = Vec::new();
            for y in curve {
                values.push(Some(y + offset + NOISE * noise));
                noise = 0.5 * noise + 0.75_f64.sqrt() * normal(&mut rng);
            }
            values
        });
        Replicate::new(r.to_string(), noisy.collect())
    };
    let layout = layouts.blocks[0].clone();
    Measurements::new(layout, replicates.map(replicate).collect()).into()
}
