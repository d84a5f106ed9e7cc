//! A small mercury target: ten gauges, polynomial chaos in place of the model and of what it holds fixed, and truths on a
//! mesh three times as fine with physics that the model does not have.

use std::sync::{Arc, OnceLock};

use lacuna::data::{Axis, Layout, Layouts, Measurements, Parameter, Replicate, Unit};
use lacuna::gap::candidates::{Candidate, proposed};
use lacuna::gap::common::shared;
use lacuna::gap::experiment::Experiment;
use lacuna::gap::fit::{Fit, fit_from};
use lacuna::gap::locate::Projection;
use lacuna::gap::name::{Options, Verdict, search, verdict};
use lacuna::gap::noise::Noise;
use lacuna::gap::system::System;
use lacuna::gap::whitener::Whitener;
use lacuna::gap::wide::{Freed, Switched, Wide};
use lacuna::linalg::Matrix;
use lacuna::linalg::vector::dot;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::CommonError;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Design, Emulator, Forward, Surrogate, registry};
use lacuna::run::{Progress, Silent};
use lacuna_plugins::models::mercury_target::{
    Cells, Gas, Mercury, Sampling, Settings, Target as Vessel,
};
use rayon::prelude::*;

const OUTPUTS: usize = 1000;
const RUNS: usize = 150;
const WIDE_RUNS: usize = 300;
const FINER_RUNS: usize = 30;
const REPLICATES: u64 = 12;

/// Order of convergence of the mesh, as in `configs/sns`.
const ORDER: f64 = 1.8;

/// Gauges with the standard deviation of their noise in microstrain, as in `configs/sns`.
const SENSORS: [(&str, f64); 10] = [
    ("B", 16.0),
    ("C", 26.0),
    ("G", 7.0),
    ("M", 6.0),
    ("R", 14.0),
    ("T", 15.0),
    ("U", 28.0),
    ("V", 13.0),
    ("Y", 14.0),
    ("Z", 12.0),
];

/// What is tried on the response, beside what the model holds fixed.
const TRIED: [&str; 9] = [
    "gain",
    "offset",
    "delay",
    "low_pass",
    "echo",
    "damping",
    "gas_attenuation",
    "crosstalk",
    "resonance",
];

/// Three parameters and then what the model holds fixed: name, absent value, prior.
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

/// The vessel on a mesh `fineness` times as fine as the study's in each direction.
pub fn settings(fineness: usize) -> Settings {
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit([10 * fineness, 45 * fineness]);
    settings.sampling = Sampling { interval: 1e-5, count: 100 };
    settings
}

/// The strain of the gauges in microstrain, one gauge after another.
pub fn strain(settings: &Settings, mercury: &Mercury, gas: Option<&Gas>) -> Vec<f64> {
    let vessel = Vessel::new(settings).unwrap();
    let outcome = match gas {
        Some(gas) => vessel.simulate_with_gas(mercury, gas),
        None => vessel.simulate(mercury),
    };
    let strain = outcome.unwrap().strain;
    let row = |name: &str| settings.gauges.0.iter().position(|g| g.name == name).unwrap();
    SENSORS.iter().flat_map(|(name, _)| strain[row(name)].iter().map(|y| 1e6 * y)).collect()
}

/// The model at its parameters, and after them what else is free.
fn model(fineness: usize, x: &[f64]) -> Vec<f64> {
    let mut settings = settings(fineness);
    let mercury = Mercury { tensile_cutoff: x[0], density: x[1], sound_speed: x[2] };
    if x.len() == 3 {
        return strain(&settings, &mercury, None);
    }
    let (void_fraction, gradient, depletion) = (x[3], x[4], x[5]);
    let gas = Gas { void_fraction, gradient, depletion, bubble_radius: 0.0, ..Gas::default() };
    settings.pulse.peak_pressure *= x[6];
    settings.pulse.wall_strain *= x[6];
    settings.pulse.width = x[7];
    settings.wall.cap_thickness *= x[8];
    settings.wall.cylinder_thickness *= x[8];
    strain(&settings, &mercury, Some(&gas))
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

/// Samples of an error, one a row.
fn error(origin: &str, samples: &Matrix, size: f64) -> CommonError {
    let scale = size / (samples.rows() as f64).sqrt();
    let factor = Matrix::from_fn(OUTPUTS, samples.rows(), |i, r| scale * samples[(r, i)]);
    CommonError { origin: origin.into(), factor, predictive: true }
}

fn difference(a: &Matrix, b: &Matrix) -> Matrix {
    Matrix::from_fn(a.rows(), a.columns(), |i, j| a[(i, j)] - b[(i, j)])
}

/// The study's emulator, and its differences when more is free: `base(x) + change(x, s) - change(x, absent)`.
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
    base: Box<dyn Emulator>,
    errors: Vec<CommonError>,
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

fn wide() -> &'static Wide<'static> {
    static MADE: OnceLock<Wide<'static>> = OnceLock::new();
    MADE.get_or_init(|| {
        let (lab, all, unknowns) = (lab(), parameters(), unknowns());
        let points = design(&all, WIDE_RUNS, 3);
        let base = lab.base.mean(&points.select_columns(&[0, 1, 2]));
        let change = fitted(&all, &points, &difference(&simulated(1, &points), &base));
        let common = vec![error("emulator of what is free", &change.fit_error().residuals, 1.0)];
        let freed = |(name, absent, prior): &(&str, f64, Distribution)| {
            Freed::new(name, Unit::dimensionless(), *absent, prior.clone())
        };
        let absent = unknowns[3..].iter().map(|(_, absent, _)| *absent).collect();
        let forward = Box::new(Widened { base: &*lab.base, change, absent });
        Wide { forward, inputs: unknowns[3..].iter().map(freed).collect(), common }
    })
}

fn switches(wide: &Wide<'_>) -> Vec<Candidate> {
    let description = |name: &str| Description {
        title: name.to_owned(),
        formula: String::new(),
        source: String::new(),
    };
    let one = |(i, input): (usize, &Freed)| Candidate {
        kind: input.name.clone(),
        plugin: input.name.clone(),
        options: toml::Table::new(),
        effect: Arc::new(Switched {
            places: vec![i],
            inputs: vec![input.clone()],
            description: description(&input.name),
        }),
    };
    wide.inputs.iter().enumerate().map(one).collect()
}

/// Replicates of a truth: gains, offsets, noise with memory.
fn measured(truth: &[f64], seed: u64) -> Measurements {
    let replicate = |r: u64| {
        let mut rng = Stream::root(seed).at(r).generator();
        let common = 0.015 * normal(&mut rng);
        let mut values = Vec::new();
        for ((_, sd), curve) in SENSORS.iter().zip(truth.chunks(100)) {
            let gain = 1.0 + common + 0.015 * normal(&mut rng);
            let offset = 2.0 * normal(&mut rng);
            let mut noise = normal(&mut rng);
            for y in curve {
                values.push(Some(gain * y + offset + sd * noise));
                noise = 0.4 * noise + 0.84_f64.sqrt() * normal(&mut rng);
            }
        }
        Replicate { name: r.to_string(), values }
    };
    let replicates = (0..REPLICATES).map(replicate).collect();
    Measurements { layout: layouts().blocks[0].clone(), replicates }
}

/// The measurements of a truth with the forward map and its errors, handed to `use_it` with where fits start.
fn experiment<T>(
    truth: &[f64],
    seed: u64,
    wide: Option<&Wide<'_>>,
    use_it: impl FnOnce(&Experiment<'_>, &[f64]) -> T,
) -> T {
    let (lab, layouts) = (lab(), layouts());
    let data = measured(truth, seed).into();
    let mut experiment = Experiment::new(&layouts, &lab.parameters, &*lab.base, &data);
    experiment.wide = wide;
    let start = [1.5e5, 13_000.0, 1300.0];
    let response = lab.base.mean(&Matrix::from_rows(3, [start])).into_vec();
    let noise = Noise::of(&experiment, &response, None);
    let mut samples = lab.errors.clone();
    samples.extend(wide.iter().flat_map(|wide| wide.common.clone()));
    let all = shared(&experiment, &noise, &response, &samples);
    (experiment.common, experiment.remainder) = (all.common, all.remainder);
    use_it(&experiment, &start)
}

/// The best fit of the model to a truth with what the tests look at: the energy of what calibration leaves.
pub fn calibrated(truth: &[f64], seed: u64) -> (Fit, f64) {
    experiment(truth, seed, None, |experiment, start| {
        let system = System::new(experiment, Vec::new());
        let noise = Noise::of(experiment, &system.response(start), None);
        let whitener = Whitener::new(experiment, &noise, &system.response(start));
        let means = experiment.means().1;
        let fit = fit_from(&system, &whitener, &means, &[start.to_vec()]).unwrap();
        let left = Projection::of(&system, &fit).rest(&fit.residual);
        (fit, dot(&left, &left))
    })
}

/// What the workflow says of a truth, and the parameters without and with what it found.
pub fn ask(truth: &[f64], seed: u64) -> (Verdict, [Vec<f64>; 2]) {
    let wide = wide();
    experiment(truth, seed, Some(wide), |experiment, start| {
        let response = experiment.forward.mean(&Matrix::from_rows(3, [start])).into_vec();
        let sd = Noise::of(experiment, &response, None).sd(experiment, &response);
        let situation = Situation { layouts: experiment.layouts, response: &response, noise: &sd };
        let tried = TRIED.map(str::to_owned);
        let mut candidates = proposed(Some(&tried), &situation).unwrap();
        candidates.extend(switches(wide));
        let options = Options { naming: 0.03, unlisted: 0.02, simulations: 99, most: 3 };
        let starts = [start.to_vec(), vec![1e5, 12_500.0, 1000.0]];
        let found = search(experiment, &candidates, &starts, options, &Stream::root(seed)).unwrap();
        let first = found.path.first().map_or(&found.last, |step| &step.before);
        let parameters = [first, &found.last].map(|look| look.fit.at.point[..3].to_vec());
        (verdict(&found, &candidates, options), parameters)
    })
}
