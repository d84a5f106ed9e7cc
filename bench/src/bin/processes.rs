//! Gaussian processes of many runs: `cargo run --release -p lacuna-bench --bin processes -- [RUNS ...] [FILE.csv ...]`.
//!
//! A number is a count of runs of Ishigami's function with ten outputs (one at each of ten values of its second
//! constant), three parameters; `borehole:RUNS` of the borehole function, eight parameters, one output. A file has one
//! point per line, parameters and then the response, as in the collection `treforevans/uci_datasets`; 64 % of its lines are
//! runs and 20 % are predicted, drawn at random. Each line of the output is JSON: seconds,
//! errors at fresh points, standardised errors, peak memory.

use std::error::Error;
use std::f64::consts::PI;
use std::fs;
use std::time::Instant;

use lacuna::data::{Axis, Layout, Layouts, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, permutation, uniform};
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Emulator, Forward};
use lacuna::run::{Progress, Silent, Tasks};
use lacuna_bench::clock::processor_seconds;
use lacuna_linalg::Matrix;
use lacuna_plugins::surrogates::gaussian_process::GaussianProcess;
use lacuna_plugins::surrogates::kriging::{Approximation, Kernel};
use lacuna_plugins::surrogates::principal_components::Components;
use serde_json::json;

type Fallible<T> = Result<T, Box<dyn Error>>;

/// Number of points that are predicted.
const FRESH: usize = 2000;

fn main() -> Fallible<()> {
    let mut approximation = Approximation::Automatic;
    for argument in std::env::args().skip(1) {
        if let Some(count) = argument.strip_prefix("neighbours=") {
            approximation = Approximation::Neighbours(count.parse()?);
        } else if argument == "exact" {
            approximation = Approximation::Exact;
        } else if let Some(runs) = argument.strip_prefix("borehole:") {
            of_function("borehole", 8, runs.parse()?, &|u| vec![borehole(u)], approximation)?;
        } else if let Ok(runs) = argument.parse() {
            of_function("ishigami", 3, runs, &ishigami, approximation)?;
        } else {
            of_file(&argument, approximation)?;
        }
    }
    Ok(())
}

/// The function of Ishigami and Homma (1990) at ten values of its second constant, on the unit cube.
fn ishigami(u: &[f64]) -> Vec<f64> {
    let x: Vec<f64> = u.iter().map(|u| (2.0 * u - 1.0) * PI).collect();
    let of = |j: usize| {
        let waves = x[0].sin() + 7.0 * (x[1] + 0.2 * j as f64).sin().powi(2);
        waves + 0.02 * (j + 1) as f64 * x[2].powi(4) * x[0].sin()
    };
    (0..10).map(of).collect()
}

/// The flow through a borehole (Harper and Gupta 1983), on the unit cube.
fn borehole(u: &[f64]) -> f64 {
    const LOW: [f64; 8] = [0.05, 100.0, 63_070.0, 990.0, 63.1, 700.0, 1120.0, 9855.0];
    const HIGH: [f64; 8] = [0.15, 50_000.0, 115_600.0, 1110.0, 116.0, 820.0, 1680.0, 12_045.0];
    let x: Vec<f64> = (0..8).map(|k| LOW[k] + u[k] * (HIGH[k] - LOW[k])).collect();
    let log = (x[1] / x[0]).ln();
    let slow = 2.0 * x[6] * x[2] / (log * x[0] * x[0] * x[7]);
    2.0 * PI * x[2] * (x[3] - x[5]) / (log * (1.0 + slow + x[2] / x[4]))
}

fn of_function(
    name: &str,
    dimension: usize,
    runs: usize,
    function: &dyn Fn(&[f64]) -> Vec<f64>,
    approximation: Approximation,
) -> Fallible<()> {
    let mut rng = Stream::root(9).generator();
    let mut draw = |count| Matrix::from_fn(count, dimension, |_, _| uniform(&mut rng));
    let (points, fresh) = (draw(runs), draw(FRESH));
    let outputs = function(&vec![0.5; dimension]).len();
    let of = |points: &Matrix| Matrix::from_rows(outputs, points.iter_rows().map(function));
    let case = Case { name, ranges: vec![[0.0, 1.0]; dimension], kernel: Kernel::Matern52 };
    case.measure([&points, &of(&points)], [&fresh, &of(&fresh)], approximation)
}

fn of_file(path: &str, approximation: Approximation) -> Fallible<()> {
    let mut lines = Vec::new();
    for line in fs::read_to_string(path)?.lines() {
        let numbers: Result<Vec<f64>, _> =
            line.split(',').map(|word| word.trim().parse()).collect();
        lines.push(numbers?);
    }
    let columns = lines.first().ok_or("an empty file")?.len();
    let all = Matrix::from_rows(columns, &lines);
    let (count, d) = (all.rows(), columns - 1);
    let order = permutation(&mut Stream::root(1).generator(), count);
    let runs = &order[..count * 16 / 25];
    let fresh = &order[count * 4 / 5..];
    let response = all.select_rows(runs).column(d);
    let mean = response.iter().sum::<f64>() / runs.len() as f64;
    let variance = response.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / runs.len() as f64;
    let parts = |rows: &[usize]| {
        let chosen = all.select_rows(rows);
        let points = chosen.select_columns(&(0..d).collect::<Vec<_>>());
        let response =
            Matrix::from_fn(rows.len(), 1, |i, _| (chosen[(i, d)] - mean) / variance.sqrt());
        (points, response)
    };
    let (run, test) = (parts(runs), parts(fresh));
    let range = |k: usize| {
        let column = all.column(k);
        let low = column.iter().copied().fold(f64::INFINITY, f64::min);
        [low, column.iter().copied().fold(low, f64::max).max(low + 1e-9)]
    };
    let ranges = (0..d).map(range).collect();
    let case = Case { name: path, ranges, kernel: Kernel::Matern32 };
    case.measure([&run.0, &run.1], [&test.0, &test.1], approximation)
}

/// A fit to be measured.
struct Case<'a> {
    name: &'a str,
    ranges: Vec<[f64; 2]>,
    kernel: Kernel,
}

impl Case<'_> {
    fn measure(
        &self,
        [points, responses]: [&Matrix; 2],
        [fresh, truth]: [&Matrix; 2],
        approximation: Approximation,
    ) -> Fallible<()> {
        let parameters: Vec<Parameter> = self.ranges.iter().enumerate().map(parameter).collect();
        let layouts = layouts(responses.columns());
        let (parameters, layouts) = (&parameters[..], &layouts);
        let training = Training { parameters, layouts, points, responses, gradients: None };
        let plugin = GaussianProcess {
            kernel: self.kernel,
            components: Components::None,
            approximation,
            ..GaussianProcess::default()
        };
        let (begun, before) = (Instant::now(), processor_seconds()?);
        let emulator =
            plugin.krige(&training, &Stream::root(1), &Progress::new(&Silent), Tasks::here())?;
        let (wall, cpu) = (begun.elapsed().as_secs_f64(), processor_seconds()? - before);
        let begun = processor_seconds()?;
        let mean = emulator.mean(fresh);
        let evaluation = (processor_seconds()? - begun) / fresh.rows() as f64;
        let begun = Instant::now();
        let variance = emulator.variance(fresh).ok_or("no variance")?;
        let of_variance = begun.elapsed().as_secs_f64() / fresh.rows() as f64;
        let (mut square, mut standard, mut inside) = (0.0, 0.0, 0);
        let values = mean.as_slice().iter().zip(truth.as_slice()).zip(variance.as_slice());
        for ((found, exact), variance) in values {
            let error = found - exact;
            square += error * error;
            standard += error * error / variance;
            inside += usize::from(error.abs() < 1.96 * variance.sqrt());
        }
        let count = mean.as_slice().len() as f64;
        let nuggets: Vec<f64> = emulator.fields.iter().map(|field| field.nugget).collect();
        let left_out = &emulator.fit_error().relative;
        let line = json!({
            "case": self.name, "runs": points.rows(), "parameters": points.columns(),
            "outputs": responses.columns(), "seconds": wall, "cpu_seconds": cpu,
            "rmse": (square / count).sqrt(),
            "standardised_rms": (standard / count).sqrt(),
            "inside_95": inside as f64 / count,
            "relative_left_out": left_out.iter().sum::<f64>() / left_out.len() as f64,
            "cpu_microseconds_of_an_evaluation": 1e6 * evaluation,
            "microseconds_of_a_variance": 1e6 * of_variance,
            "nugget_of_first": nuggets.first(),
            "peak_megabytes": peak()?,
        });
        println!("{line}");
        Ok(())
    }
}

fn parameter((k, range): (usize, &[f64; 2])) -> Parameter {
    let law = Distribution::Uniform(*range);
    let (name, symbol) = (format!("x{k}"), format!("x{k}"));
    let unit = Unit::dimensionless();
    Parameter { name, symbol, unit, design: law.clone(), prior: law, reference: None }
}

fn layouts(outputs: usize) -> Layouts {
    let places = (0..outputs).map(|j| j as f64).collect();
    let axes = vec![Axis::grid("place", places, Unit::dimensionless())];
    Layout { name: "y".into(), unit: Unit::dimensionless(), axes }.into()
}

/// Largest memory of the process so far, in megabytes, as reported by Linux.
fn peak() -> Fallible<f64> {
    let status = fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.split_whitespace().next()).ok_or("no `VmHWM`")?;
    Ok(kilobytes.parse::<f64>()? / 1024.0)
}
