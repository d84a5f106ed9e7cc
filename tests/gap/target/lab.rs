//! The study of the vessel: a polynomial chaos expansion in place of the model, including quantities that the model
//! fixes, with their errors.

use std::sync::OnceLock;

use lacuna::data::{Axis, Layout, Layouts, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::CommonError;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Design, Emulator, Forward, Surrogate, registry};
use lacuna::run::{Progress, Silent};
use lacuna_engine::gap::experiment::wider::{ExtendedMap, FreeInput};
use lacuna_linalg::Matrix;
use lacuna_plugins::models::mercury_target::{Gas, Mercury, Target};
use rayon::prelude::*;

use super::vessel::{SENSORS, settings, strain};

pub const OUTPUTS: usize = 1000;
const RUNS: usize = 150;
const WIDE_RUNS: usize = 300;
const FINER_RUNS: usize = 30;

/// Order of convergence of the mesh, as in `configs/sns`.
const ORDER: f64 = 1.8;

/// Three parameters, followed by the quantities that the model fixes: name, value at which the effect is absent, prior.
fn unknowns() -> Vec<(&'static str, f64, Distribution)> {
    use Distribution::{TruncatedNormal, Uniform};
    vec![
        ("tensile_cutoff", 1.5e5, Uniform([0.0, 5e5])),
        ("density", 13_500.0, Uniform([10_000.0, 13_600.0])),
        ("sound_speed", 1456.0, Uniform([800.0, 1800.0])),
        ("void_fraction", 0.0, Uniform([0.0, 4e-4])),
        ("void_gradient", 0.0, Uniform([-0.8, 0.8])),
        ("void_depletion", 0.0, Uniform([0.0, 0.9])),
        ("pulse_energy", 1.0, TruncatedNormal([1.0, 0.05, 0.8, 1.2])),
        ("beam_width", 0.032, TruncatedNormal([0.032, 0.002, 0.026, 0.038])),
        ("wall_thickness", 1.0, TruncatedNormal([1.0, 0.05, 0.85, 1.15])),
    ]
}

fn parameters() -> Vec<Parameter> {
    let parameter = |(name, _, prior): (&str, f64, Distribution)| {
        let (low, high) = prior.support();
        let design = Distribution::Uniform([low, high]);
        Parameter { design, ..Parameter::plain(name, prior) }
    };
    unknowns().into_iter().map(parameter).collect()
}

pub fn layouts() -> Layouts {
    let times = (1..=100).map(|i| f64::from(i) * 1e-5).collect();
    let axes = vec![
        Axis::labels("sensor", SENSORS.map(|(name, _)| name)),
        Axis::grid("time", times, Unit::parse("s").unwrap()),
    ];
    Layout { name: "strain".into(), unit: Unit::dimensionless(), axes }.into()
}

/// The model as a function of its parameters, followed by the other free quantities.
fn model(fineness: usize, x: &[f64]) -> Vec<f64> {
    let mut settings = settings(fineness);
    let mercury = Mercury { tensile_cutoff: x[0], density: x[1], sound_speed: x[2] };
    if x.len() == 3 {
        let outcome = Target::new(&settings).unwrap().simulate(&mercury).unwrap();
        return strain(&settings, &outcome);
    }
    let (void_fraction, gradient, depletion) = (x[3], x[4], x[5]);
    let gas = Gas { void_fraction, gradient, depletion, bubble_radius: 0.0, ..Gas::default() };
    settings.pulse.peak_pressure *= x[6];
    settings.pulse.wall_strain *= x[6];
    settings.pulse.width = x[7];
    settings.wall.cap_thickness *= x[8];
    settings.wall.cylinder_thickness *= x[8];
    let outcome = Target::new(&settings).unwrap().simulate_with_gas(&mercury, &gas).unwrap();
    strain(&settings, &outcome)
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
    let training = Training { parameters, layouts: &layouts, points, responses };
    surrogate.plugin.fit(&training, &Stream::root(2), &Progress::new(&Silent)).unwrap()
}

/// Samples of an error, one per row, as a common error of the given size.
fn error(origin: &str, samples: &Matrix, size: f64) -> CommonError {
    let scale = size / (samples.rows() as f64).sqrt();
    let factor = Matrix::from_fn(OUTPUTS, samples.rows(), |i, r| scale * samples[(r, i)]);
    CommonError { origin: origin.into(), factor, predictive: true }
}

fn difference(a: &Matrix, b: &Matrix) -> Matrix {
    Matrix::from_fn(a.rows(), a.columns(), |i, j| a[(i, j)] - b[(i, j)])
}

/// The study's emulator, plus its change if further quantities are free: `base(x) + change(x, s) - change(x, absent)`.
struct Widened {
    base: &'static dyn Emulator,
    change: Box<dyn Emulator>,
    absent: Vec<f64>,
}

impl Widened {
    fn without(&self, point: &[f64]) -> Vec<f64> {
        [&point[..3], &self.absent[..]].concat()
    }
}

impl Forward for Widened {
    fn dimension(&self) -> usize {
        self.change.dimension()
    }

    fn outputs(&self) -> usize {
        OUTPUTS
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        let rows = points.iter_rows().map(|p| self.without(p));
        let without = self.change.mean(&Matrix::from_rows(points.columns(), rows));
        let change = difference(&self.change.mean(points), &without);
        let base = self.base.mean(&points.select_columns(&[0, 1, 2]));
        Matrix::from_fn(points.rows(), OUTPUTS, |i, j| base[(i, j)] + change[(i, j)])
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        let base = self.base.jacobian(&point[..3]);
        let without = self.change.jacobian(&self.without(point));
        let mut all = self.change.jacobian(point);
        for i in 0..OUTPUTS {
            (0..3).for_each(|j| all[(i, j)] += base[(i, j)] - without[(i, j)]);
        }
        all
    }
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
        let parameters = parameters()[..3].to_vec();
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

pub fn wide() -> &'static ExtendedMap<'static> {
    static MADE: OnceLock<ExtendedMap<'static>> = OnceLock::new();
    MADE.get_or_init(|| {
        let (lab, all, unknowns) = (lab(), parameters(), unknowns());
        let points = design(&all, WIDE_RUNS, 3);
        let base = lab.base.mean(&points.select_columns(&[0, 1, 2]));
        let change = fitted(&all, &points, &difference(&simulated(1, &points), &base));
        let common = vec![error("emulator of what is free", &change.fit_error().residuals, 1.0)];
        let freed = |(name, absent, prior): &(&str, f64, Distribution)| {
            FreeInput::new(name, Unit::dimensionless(), *absent, prior.clone())
        };
        let absent = unknowns[3..].iter().map(|(_, absent, _)| *absent).collect();
        let forward = Box::new(Widened { base: &*lab.base, change, absent });
        ExtendedMap { forward, inputs: unknowns[3..].iter().map(freed).collect(), common }
    })
}
