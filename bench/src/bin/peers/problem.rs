//! A problem of the founding study's size, made here and read by both sides.
//!
//! Arrays are raw little-endian numbers; `problem.json` states their shapes, the ranges of the parameters and the prior
//! of the variance.

use std::fs;
use std::path::Path;

use lacuna::data::{Axis, Layout, Measurements, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna_linalg::Matrix;
use serde_json::json;

use crate::Fallible;

pub const SENSORS: usize = 10;
pub const TIMES: usize = 100;
pub const OUTPUTS: usize = SENSORS * TIMES;
pub const TRAINING: usize = 480;
pub const VALIDATION: usize = 123;
pub const REPLICATES: usize = 20;
/// Ranges of the cutoff in pascal, the density in kg/m3, the speed of sound in m/s.
pub const RANGES: [[f64; 2]; 3] = [[0.0, 5e5], [1e4, 1.36e4], [1200.0, 2200.0]];
const TRUTH: [f64; 3] = [1.7e5, 1.21e4, 1850.0];
/// Standard deviation of a replicate, microstrain.
const NOISE: f64 = 32.0;
/// Scale of the half-normal prior of the variance, microstrain squared.
pub const VARIANCE_SCALE: f64 = 1e6;

/// Makes all arrays of the problem.
pub fn write(folder: &Path) -> Fallible<()> {
    fs::create_dir_all(folder)?;
    let points = design(TRAINING + VALIDATION);
    let responses = Matrix::from_rows(OUTPUTS, points.iter_rows().map(response));
    let parts = |m: &Matrix| {
        let all: Vec<usize> = (0..TRAINING + VALIDATION).collect();
        (m.select_rows(&all[..TRAINING]), m.select_rows(&all[TRAINING..]))
    };
    let ((training, validation), (taught, kept)) = (parts(&points), parts(&responses));
    let arrays = [
        ("training_points", training),
        ("training_responses", taught),
        ("validation_points", validation),
        ("validation_responses", kept),
        ("curves", curves()),
    ];
    let mut shapes = serde_json::Map::new();
    for (name, array) in &arrays {
        save(folder, name, array)?;
        shapes.insert((*name).to_owned(), json!([array.rows(), array.columns()]));
    }
    let header = json!({
        "shapes": shapes, "ranges": RANGES, "truth": TRUTH, "noise": NOISE,
        "variance_scale": VARIANCE_SCALE,
    });
    Ok(fs::write(folder.join("problem.json"), serde_json::to_vec_pretty(&header)?)?)
}

/// Writes an array.
pub fn save(folder: &Path, name: &str, array: &Matrix) -> Fallible<()> {
    let bytes: Vec<u8> = array.as_slice().iter().flat_map(|x| x.to_le_bytes()).collect();
    Ok(fs::write(folder.join(format!("{name}.f64")), bytes)?)
}

/// Reads an array with this number of columns.
pub fn load(folder: &Path, name: &str, columns: usize) -> Fallible<Matrix> {
    let path = folder.join(format!("{name}.f64"));
    let bytes = fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let (numbers, _) = bytes.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|x| f64::from_le_bytes(*x)).collect();
    Ok(Matrix::from_vec(numbers.len() / columns, columns, numbers))
}

/// Strain of a damped wave, in microstrain.
///
/// It arrives at each sensor at a time that depends on the speed of sound, and stays at the cutoff where the wall would
/// pull the liquid below it: a smooth function with a slightly rounded kink.
fn response(point: &[f64]) -> Vec<f64> {
    const ROUNDING: f64 = 15.0;
    let unit = |i: usize| (point[i] - RANGES[i][0]) / (RANGES[i][1] - RANGES[i][0]);
    let (cutoff, density, speed) = (120.0 + 600.0 * unit(0), point[1] / 1e4, point[2] / 1e3);
    let strain = |k: usize| {
        let (sensor, time) = ((k / TIMES) as f64, (k % TIMES) as f64 / TIMES as f64);
        let since = time - (0.05 + 0.03 * sensor) / speed;
        let front = 1.0 / (1.0 + (-since / 0.03).exp());
        let turns = (2.0 + 0.08 * sensor) * (speed / density).sqrt() * since;
        let wave = 1400.0 / density * front * (-1.5 * since.max(-0.2)).exp();
        let free = wave * (std::f64::consts::TAU * turns).sin();
        ROUNDING * ((free + cutoff) / ROUNDING).exp().ln_1p() - cutoff
    };
    (0..OUTPUTS).map(strain).collect()
}

fn design(count: usize) -> Matrix {
    let mut rng = Stream::root(1).generator();
    Matrix::from_fn(count, RANGES.len(), |_, i| {
        RANGES[i][0] + uniform(&mut rng) * (RANGES[i][1] - RANGES[i][0])
    })
}

/// The replicates and, as in the founding study, their mean as a further curve.
fn curves() -> Matrix {
    let truth = response(&TRUTH);
    let mut rng = Stream::root(2).generator();
    let replicates =
        Matrix::from_fn(REPLICATES, OUTPUTS, |_, j| truth[j] + NOISE * normal(&mut rng));
    let mean = (0..OUTPUTS).map(|j| replicates.column(j).iter().sum::<f64>() / REPLICATES as f64);
    let mean: Vec<f64> = mean.collect();
    Matrix::from_rows(OUTPUTS, replicates.iter_rows().chain([&mean[..]]))
}

/// The parameters, whose priors are the ranges of the design.
pub fn parameters() -> Fallible<Vec<Parameter>> {
    let named = |(range, (name, unit)): (&[f64; 2], (&str, &str))| {
        Ok(Parameter {
            name: name.to_owned(),
            symbol: name.to_owned(),
            unit: Unit::parse(unit)?,
            design: Distribution::Uniform(*range),
            prior: Distribution::Uniform(*range),
            reference: None,
        })
    };
    let names = [("cutoff", "Pa"), ("density", "kg/m^3"), ("speed", "m/s")];
    RANGES.iter().zip(names).map(named).collect()
}

/// Layout of a response with the first `outputs` outputs.
pub fn layout(outputs: usize) -> Fallible<Layout> {
    let grid = (0..outputs).map(|k| k as f64).collect();
    let axes = vec![Axis::grid("output", grid, Unit::parse("1")?)];
    Ok(Layout { name: "strain".into(), unit: Unit::parse("1")?, axes })
}

/// The measured curves.
pub fn measurements(folder: &Path) -> Fallible<Measurements> {
    let curves = load(folder, "curves", OUTPUTS)?;
    let replicate = |(r, values): (usize, &[f64])| {
        Replicate::new(r.to_string(), values.iter().map(|&y| Some(y)).collect())
    };
    let replicates = curves.iter_rows().enumerate().map(replicate).collect();
    Ok(Measurements::new(layout(OUTPUTS)?, replicates))
}
