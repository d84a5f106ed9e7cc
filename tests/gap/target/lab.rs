//! The study of the vessel: a polynomial chaos expansion in place of the model, with its errors.

use std::sync::OnceLock;

use lacuna::data::{Axis, Layout, Layouts, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::CommonError;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Design, Emulator, Surrogate, registry};
use lacuna::run::{Progress, Silent};
use lacuna_linalg::Matrix;
use lacuna_plugins::models::mercury_target::{Mercury, Target};
use rayon::prelude::*;

use super::vessel::{SENSORS, settings, strain};

pub const OUTPUTS: usize = 1000;
const RUNS: usize = 150;
const FINER_RUNS: usize = 30;

/// Order of convergence of the mesh, as in `configs/sns`.
const ORDER: f64 = 1.8;

fn parameters() -> Vec<Parameter> {
    let parameter = |(name, range): (&str, [f64; 2])| {
        let law = Distribution::Uniform(range);
        Parameter { design: law.clone(), ..Parameter::plain(name, law) }
    };
    let ranges = [
        ("tensile_cutoff", [0.0, 5e5]),
        ("density", [10_000.0, 13_600.0]),
        ("sound_speed", [800.0, 1800.0]),
    ];
    ranges.into_iter().map(parameter).collect()
}

pub fn layouts() -> Layouts {
    let times = (1..=100).map(|i| f64::from(i) * 1e-5).collect();
    let axes = vec![
        Axis::labels("sensor", SENSORS.map(|(name, _)| name)),
        Axis::grid("time", times, Unit::parse("s").unwrap()),
    ];
    Layout { name: "strain".into(), unit: Unit::dimensionless(), axes }.into()
}

/// The model as a function of its parameters.
fn model(fineness: usize, x: &[f64]) -> Vec<f64> {
    let settings = settings(fineness);
    let mercury = Mercury { tensile_cutoff: x[0], density: x[1], sound_speed: x[2] };
    strain(&settings, &Target::new(&settings).unwrap().simulate(&mercury).unwrap())
}

pub fn design(parameters: &[Parameter], runs: usize, seed: u64) -> Matrix {
    let design = registry::from_text::<dyn Design>("latin_hypercube", "").unwrap().plugin;
    let unit = design.points(runs, parameters.len(), &Stream::root(seed)).unwrap();
    Matrix::from_fn(runs, parameters.len(), |i, j| parameters[j].design.quantile(unit[(i, j)]))
}

pub fn simulated(fineness: usize, points: &Matrix) -> Matrix {
    let rows: Vec<Vec<f64>> =
        (0..points.rows()).into_par_iter().map(|i| model(fineness, points.row(i))).collect();
    Matrix::from_rows(OUTPUTS, rows)
}

fn fitted(parameters: &[Parameter], points: &Matrix, responses: &Matrix) -> Box<dyn Emulator> {
    let layouts = layouts();
    let options = "degree = { max = 10 }\nq_norm = 0.75";
    let surrogate = registry::from_text::<dyn Surrogate>("polynomial_chaos", options).unwrap();
    let training = Training { parameters, layouts: &layouts, points, responses, gradients: None };
    surrogate.plugin.fit(&training, &Stream::root(2), &Progress::new(&Silent)).unwrap()
}

/// Samples of an error, one per row, as a common error of the given size.
fn error(origin: &str, samples: &Matrix, size: f64) -> CommonError {
    let scale = size / (samples.rows() as f64).sqrt();
    let factor = Matrix::from_fn(OUTPUTS, samples.rows(), |i, r| scale * samples[(r, i)]);
    CommonError { origin: origin.into(), factor: factor.into(), predictive: true }
}

fn difference(a: &Matrix, b: &Matrix) -> Matrix {
    Matrix::from_fn(a.rows(), a.columns(), |i, j| a[(i, j)] - b[(i, j)])
}

/// The study: its emulator with samples of its errors.
pub struct Lab {
    pub parameters: Vec<Parameter>,
    pub base: Box<dyn Emulator>,
    pub errors: Vec<CommonError>,
}

pub fn lab() -> &'static Lab {
    static MADE: OnceLock<Lab> = OnceLock::new();
    MADE.get_or_init(|| {
        let parameters = parameters();
        let points = design(&parameters, RUNS, 1);
        let responses = simulated(1, &points);
        let base = fitted(&parameters, &points, &responses);
        let some: Vec<usize> = (0..FINER_RUNS).collect();
        let finer = simulated(2, &points.select_rows(&some));
        let mesh = difference(&finer, &responses.select_rows(&some));
        let whole = 1.0 / (1.0 - 2.0_f64.powf(-ORDER));
        let errors =
            vec![error("emulator", &base.fit_error().residuals, 1.0), error("mesh", &mesh, whole)];
        Lab { parameters, base, errors }
    })
}
