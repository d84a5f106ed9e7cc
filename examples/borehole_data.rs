//! Makes the tables of `configs/borehole`: `cargo run --release -p lacuna-examples --bin borehole_data`.
//!
//! The flow of water through a borehole between two aquifers (Harper and Gupta, *Sensitivity/uncertainty analysis of a
//! borehole scenario*, BMI/ONWI-516, 1983), with their distributions of the eight parameters; years are converted to
//! days. A pumping test is simulated: the flow is measured at the original radius and after reaming the hole to twice,
//! four and eight times that, each with the upper aquifer as it is and drawn down by 75 and 150 m.

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Design;
use lacuna_plugins::designs::sobol::Sobol;

const SEED: u64 = 19_830_516;
const RUNS: usize = 200;
const REPLICATES: usize = 6;
/// Radii in units of the original radius.
const REAMED: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Drawdown of the upper aquifer, m.
const DRAWDOWN: [f64; 3] = [0.0, 75.0, 150.0];
/// Standard deviation of a measured flow, as a fraction of the flow without drawdown.
const NOISE: f64 = 0.01;
const DAYS: f64 = 365.25;

/// Name, unit, distribution and true value of each parameter.
fn parameters() -> [(&'static str, &'static str, Distribution, f64); 8] {
    let yearly = |low: f64, high: f64| Distribution::Uniform([low / DAYS, high / DAYS]);
    [
        ("radius", "m", Distribution::Normal([0.10, 0.016_181_2]), 0.115),
        ("influence", "m", Distribution::LogNormal([7.71, 1.0056]), 3200.0),
        ("upper_transmissivity", "m2/d", yearly(63_070.0, 115_600.0), 265.0),
        ("upper_head", "m", Distribution::Uniform([990.0, 1110.0]), 1062.0),
        ("lower_transmissivity", "m2/d", yearly(63.1, 116.0), 0.21),
        ("lower_head", "m", Distribution::Uniform([700.0, 820.0]), 748.0),
        ("length", "m", Distribution::Uniform([1120.0, 1680.0]), 1290.0),
        ("conductivity", "m/d", yearly(9855.0, 12_045.0), 31.0),
    ]
}

/// Flow in m3/d.
fn flow(parameters: &[f64], reamed: f64, drawdown: f64) -> f64 {
    let &[radius, influence, upper, upper_head, lower, lower_head, length, conductivity] =
        parameters
    else {
        return f64::NAN;
    };
    let radius = radius * reamed;
    let log = (influence / radius).ln();
    let hole = 2.0 * length * upper / (log * radius * radius * conductivity);
    let head = upper_head - drawdown - lower_head;
    std::f64::consts::TAU * upper * head / (log * (1.0 + hole + upper / lower))
}

fn main() -> Result<(), Box<dyn Error>> {
    let parameters = parameters();
    let root = Stream::root(SEED);
    let cube = Sobol::default().points(RUNS, parameters.len(), &root.named("design"))?;

    let heads = parameters.iter().map(|(name, unit, ..)| format!(",{name} [{unit}]"));
    let mut runs = format!("run{}\n", heads.collect::<String>());
    let mut responses = "run,reamed,drawdown [m],flow [m3/d]\n".to_owned();
    for i in 0..RUNS {
        let laws = parameters.iter().map(|(_, _, law, _)| law);
        // Simulate the numbers as written, so that the table is exact.
        let point: Result<Vec<f64>, _> = laws
            .zip(cube.row(i))
            .map(|(law, u)| format!("{:.6e}", law.quantile(*u)).parse())
            .collect();
        let point: Vec<f64> = point?;
        let cells: String = point.iter().map(|x| format!(",{x}")).collect();
        writeln!(runs, "r{:03}{cells}", i + 1)?;
        for (reamed, drawdown) in places() {
            let flow = flow(&point, reamed, drawdown);
            writeln!(responses, "r{:03},{reamed},{drawdown},{flow:.8e}", i + 1)?;
        }
    }

    let truth: Vec<f64> = parameters.iter().map(|(.., truth)| *truth).collect();
    let mut measurements = "replicate,reamed,drawdown [m],flow [m3/d]\n".to_owned();
    for replicate in 1..=REPLICATES {
        let mut rng = root.named("noise").at(replicate as u64).generator();
        for (reamed, drawdown) in places() {
            let noise = NOISE * flow(&truth, reamed, 0.0) * normal(&mut rng);
            let flow = flow(&truth, reamed, drawdown) + noise;
            writeln!(measurements, "{replicate},{reamed},{drawdown},{flow:.5}")?;
        }
    }

    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/borehole");
    std::fs::write(folder.join("runs.csv"), runs)?;
    std::fs::write(folder.join("responses.csv"), responses)?;
    std::fs::write(folder.join("measurements.csv"), measurements)?;
    Ok(())
}

/// All pairs of radius and drawdown, in the order of the response's axes.
fn places() -> impl Iterator<Item = (f64, f64)> {
    REAMED.into_iter().flat_map(|reamed| DRAWDOWN.map(|drawdown| (reamed, drawdown)))
}
