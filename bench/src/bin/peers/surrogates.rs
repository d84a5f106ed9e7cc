//! Fitting surrogates, and evaluating one.

use std::fs;
use std::hint::black_box;
use std::path::Path;

use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Emulator, Surrogate};
use lacuna::run::{Progress, Silent};
use lacuna_bench::clock::timed;
use lacuna_linalg::Matrix;
use lacuna_plugins::surrogates::gaussian_process::GaussianProcess;
use lacuna_plugins::surrogates::polynomial_chaos::{Degree, PolynomialChaos};
use lacuna_plugins::surrogates::principal_components::Components;
use serde_json::{Value, json};

use crate::Fallible;
use crate::problem::{self, OUTPUTS, RANGES};

/// Name of the expansion with a separate degree for each output.
pub const ADAPTIVE: &str = "adaptive";
/// Name of the expansion of degree 10.
pub const SMALL: &str = "degree_10";
/// Number of points at which the expansion is evaluated.
const EVALUATIONS: usize = 100_000;
/// Number of points whose values are written for comparison by the other side.
const COMPARED: usize = 1000;
/// Number of outputs emulated by Gaussian processes: every hundredth, from the middle of the first sensor.
const PROCESSES: usize = 10;

/// Sparse expansions of all outputs, of adaptive degree and of degree 10; keeps the emulators for the other jobs.
pub fn polynomial_chaos(folder: &Path) -> Fallible<Value> {
    let small = PolynomialChaos { degree: Degree::Fixed(10), ..PolynomialChaos::default() };
    Ok(json!({
        ADAPTIVE: expansion(&PolynomialChaos::default(), folder, ADAPTIVE)?,
        SMALL: expansion(&small, folder, SMALL)?,
    }))
}

fn expansion(options: &PolynomialChaos, folder: &Path, name: &str) -> Fallible<Value> {
    let outputs: Vec<usize> = (0..OUTPUTS).collect();
    let (emulator, seconds) = fit(options, folder, &outputs)?;
    let linear = emulator.linear().ok_or("the expansion is not linear")?;
    let bytes = emulator.save()?;
    let exponents = exponents(&bytes)?;
    fs::write(folder.join(format!("{name}.bin")), bytes)?;
    problem::save(folder, &format!("{name}_coefficients"), linear.coefficients())?;
    problem::save(folder, &format!("{name}_exponents"), &exponents)?;
    let used = linear.coefficients().as_slice().iter().filter(|c| **c != 0.0).count();
    let facts = emulator.facts();
    Ok(json!({
        "cpu_seconds": seconds,
        "cpu_seconds_of_an_output": seconds / OUTPUTS as f64,
        "loo": emulator.fit_error().relative,
        "rmse": validation(&*emulator, folder, &outputs)?,
        "terms_of_an_output": used as f64 / OUTPUTS as f64,
        "terms_of_all": exponents.rows(),
        "facts": facts.iter().map(|f| format!("{}: {}", f.name, f.value)).collect::<Vec<_>>(),
    }))
}

/// Gaussian processes of a few outputs, each with its own hyperparameters.
pub fn gaussian_process(folder: &Path) -> Fallible<Value> {
    let options = GaussianProcess { components: Components::None, ..GaussianProcess::default() };
    let outputs: Vec<usize> =
        (0..PROCESSES).map(|i| i * OUTPUTS / PROCESSES + OUTPUTS / PROCESSES / 2).collect();
    let (emulator, seconds) = fit(&options, folder, &outputs)?;
    let rmse = validation(&*emulator, folder, &outputs)?;
    Ok(json!({ "cpu_seconds": seconds, "outputs": outputs, "rmse": rmse }))
}

/// The expansion of all outputs at many points, evaluated in pieces.
pub fn evaluation(folder: &Path) -> Fallible<Value> {
    let emulator = emulator(folder, ADAPTIVE)?;
    let mut rng = Stream::root(4).generator();
    let points = Matrix::from_fn(EVALUATIONS, RANGES.len(), |_, i| {
        RANGES[i][0] + uniform(&mut rng) * (RANGES[i][1] - RANGES[i][0])
    });
    problem::save(folder, "evaluation_points", &points)?;
    let first: Vec<usize> = (0..COMPARED).collect();
    let compared = emulator.mean(&points.select_rows(&first));
    problem::save(folder, "evaluation_values", &compared)?;
    let mut seconds = serde_json::Map::new();
    for size in [256, 2048] {
        let pieces: Vec<Matrix> = (0..EVALUATIONS)
            .step_by(size)
            .map(|start| {
                let rows: Vec<usize> = (start..EVALUATIONS.min(start + size)).collect();
                points.select_rows(&rows)
            })
            .collect();
        let evaluate = || pieces.iter().for_each(|piece| drop(black_box(emulator.mean(piece))));
        seconds.insert(size.to_string(), json!(timed(evaluate)?.1));
    }
    Ok(json!({ "points": EVALUATIONS, "cpu_seconds_by_chunk": seconds }))
}

/// An expansion that the first job kept.
pub fn emulator(folder: &Path, name: &str) -> Fallible<Box<dyn Emulator>> {
    let bytes = fs::read(folder.join(format!("{name}.bin")))
        .map_err(|e| format!("the job `polynomial_chaos` comes first: {e}"))?;
    Ok(PolynomialChaos::default().load(&bytes)?)
}

/// Fits an emulator of some outputs; returns it with the time it took.
fn fit(
    options: &dyn Surrogate,
    folder: &Path,
    outputs: &[usize],
) -> Fallible<(Box<dyn Emulator>, f64)> {
    let points = problem::load(folder, "training_points", RANGES.len())?;
    let responses = problem::load(folder, "training_responses", OUTPUTS)?.select_columns(outputs);
    let (parameters, layout) = (problem::parameters()?, problem::layout(outputs.len())?);
    let training = Training {
        parameters: &parameters,
        layouts: &layout.into(),
        points: &points,
        responses: &responses,
        gradients: None,
    };
    let progress = Progress::new(&Silent);
    let (emulator, seconds) = timed(|| options.fit(&training, &Stream::root(3), &progress))?;
    Ok((emulator?, seconds))
}

/// Root mean square error of each output over the held-out runs.
fn validation(emulator: &dyn Emulator, folder: &Path, outputs: &[usize]) -> Fallible<Vec<f64>> {
    let points = problem::load(folder, "validation_points", RANGES.len())?;
    let truth = problem::load(folder, "validation_responses", OUTPUTS)?.select_columns(outputs);
    let mean = emulator.mean(&points);
    let error = |j: usize| {
        let squares = (0..mean.rows()).map(|i| (mean[(i, j)] - truth[(i, j)]).powi(2));
        (squares.sum::<f64>() / mean.rows() as f64).sqrt()
    };
    Ok((0..outputs.len()).map(error).collect())
}

/// Degrees of the polynomials of each term, from the header of a saved expansion.
fn exponents(bytes: &[u8]) -> Fallible<Matrix> {
    let begin = bytes.iter().position(|&b| b == b'\n').ok_or("no first line")? + 1;
    let (length, rest) = bytes[begin..].split_first_chunk::<8>().ok_or("no header")?;
    let length = usize::try_from(u64::from_le_bytes(*length))?;
    let header: Value = serde_json::from_slice(rest.get(..length).ok_or("no whole header")?)?;
    let degrees: Vec<f64> = serde_json::from_value(header["exponents"].clone())?;
    Ok(Matrix::from_vec(degrees.len() / RANGES.len(), RANGES.len(), degrees))
}
