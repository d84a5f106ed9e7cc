//! Fits to published functions of many inputs.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use lacuna::data::{Layout, Parameter};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::Design as _;
use lacuna::plugin::surrogate::{Emulator, Surrogate, Training};
use lacuna::run::{Progress, Silent};
use lacuna_linalg::Matrix;

use super::functions::{Function, borehole, diffusion, morris, uqlab, welch};
use crate::designs::latin_hypercube::LatinHypercube;
use crate::surrogates::gaussian_process::GaussianProcess;
use crate::surrogates::polynomial_chaos::{PolynomialChaos, QNorm, Selection};

/// Runs of a function, and new points with its values.
pub struct Case {
    parameters: Vec<Parameter>,
    points: Matrix,
    responses: Matrix,
    fresh: Matrix,
    truth: Matrix,
}

impl Case {
    pub fn new(function: &Function, runs: usize, seed: u64) -> Self {
        let parameters: Vec<Parameter> = (function.designs.iter().enumerate())
            .map(|(i, design)| Parameter::plain(&format!("x{}", i + 1), design.clone()))
            .collect();
        let placed = |cube: &Matrix| {
            Matrix::from_fn(cube.rows(), cube.columns(), |i, j| {
                parameters[j].design.quantile(cube[(i, j)])
            })
        };
        let design = LatinHypercube::default();
        let points = placed(&design.points(runs, parameters.len(), &Stream::root(seed)).unwrap());
        let mut rng = Stream::root(99).generator();
        let fresh = placed(&Matrix::from_fn(2000, parameters.len(), |_, _| uniform(&mut rng)));
        let values = |points: &Matrix| {
            Matrix::from_rows(1, points.iter_rows().map(|x| [(function.value)(x)]))
        };
        let (responses, truth) = (values(&points), values(&fresh));
        Self { parameters, points, responses, fresh, truth }
    }

    fn fit(&self, surrogate: &dyn Surrogate) -> Box<dyn Emulator> {
        self.fit_to(surrogate, None)
    }

    /// Fits a surrogate to the values and these derivatives.
    pub fn fit_to(
        &self,
        surrogate: &dyn Surrogate,
        gradients: Option<&Matrix>,
    ) -> Box<dyn Emulator> {
        let layouts = Layout::number("y").into();
        let training = Training {
            parameters: &self.parameters,
            layouts: &layouts,
            points: &self.points,
            responses: &self.responses,
            gradients,
        };
        let stream = Stream::root(3).named("surrogate");
        surrogate.fit(&training, &stream, &Progress::new(&Silent)).unwrap()
    }

    /// Mean square error at the new points divided by the variance.
    pub fn error(&self, emulator: &dyn Emulator) -> f64 {
        let (found, truth) = (emulator.mean(&self.fresh), self.truth.as_slice());
        let mean = truth.iter().sum::<f64>() / truth.len() as f64;
        let error: f64 = found.as_slice().iter().zip(truth).map(|(a, b)| (a - b).powi(2)).sum();
        error / truth.iter().map(|y| (y - mean).powi(2)).sum::<f64>()
    }
}

/// Derivatives of a function at the runs of a case by central differences of the fourth order: with steps of a thousandth
/// of the scale of an input, the error of the formula is about 1e-13 of the scale of the function.
pub fn slopes(function: &Function, case: &Case) -> Matrix {
    let step = |j: usize| {
        1e-3 * match function.designs[j] {
            Distribution::Uniform([low, high]) => 0.5 * (high - low),
            _ => 1.0,
        }
    };
    Matrix::from_fn(case.points.rows(), function.designs.len(), |i, j| {
        let at = |steps: f64| {
            let mut moved = case.points.row(i).to_vec();
            moved[j] += steps * step(j);
            (function.value)(&moved)
        };
        (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step(j))
    })
}

/// The function of Welch et al. (1992) is a short polynomial but for one quotient; the paper's kriging has a root
/// mean square error of a tenth of the standard deviation or so with 50 runs, and a sparse basis with few products
/// does better from 100.
#[test]
fn twenty_inputs_need_a_hundred_runs() {
    let case = Case::new(&welch(), 100, 1);
    let error = case.error(&*case.fit(&PolynomialChaos::default()));
    assert!(error < 2e-3, "{error}");
}

/// The default basis of 100 inputs has products: the function of UQLab's example in high dimension has five of them,
/// and its nonlinear terms are beyond degree 1.
#[test]
fn a_hundred_inputs_have_products_of_two_by_default() {
    let options = PolynomialChaos::default();
    let sets = options.sets(100);
    assert!(sets.terms.len() < 12_000, "{}", sets.terms.len());
    let most =
        (0..sets.terms.len()).map(|t| sets.terms.term(t).iter().filter(|e| **e > 0).count()).max();
    assert_eq!(most, Some(2));
    assert!(sets.sets.last().unwrap().degree >= 4);
}

/// The functions of the tables and the numbers of runs.
pub fn cases() -> [(Function, &'static [usize]); 6] {
    [
        (borehole(), &[20, 100, 300]),
        (welch(), &[100, 200, 500]),
        (morris(), &[200, 500]),
        (diffusion(50), &[100, 200, 500]),
        (diffusion(100), &[100, 200, 500]),
        (uqlab(), &[100, 200, 300, 500]),
    ]
}

/// Writes points, values and slopes of a function as a table. Coordinates and slopes are those of the standard variables:
/// uniform from -1 to 1, or standard normal. The slopes are central differences.
fn export(path: &Path, function: &Function, points: &Matrix) {
    let scales: Vec<(f64, f64)> = function
        .designs
        .iter()
        .map(|design| match design {
            Distribution::Uniform([low, high]) => (0.5 * (low + high), 0.5 * (high - low)),
            _ => (0.0, 1.0),
        })
        .collect();
    let mut text = String::new();
    for point in points.iter_rows() {
        let mut cells = vec![(function.value)(point)];
        cells.extend(point.iter().zip(&scales).map(|(x, (middle, scale))| (x - middle) / scale));
        for (j, (_, scale)) in scales.iter().enumerate() {
            let step = 1e-5;
            let at = |side: f64| {
                let mut moved = point.to_vec();
                moved[j] += side * step * scale;
                (function.value)(&moved)
            };
            cells.push((at(1.0) - at(-1.0)) / (2.0 * step));
        }
        text += &cells.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        text.push('\n');
    }
    fs::write(path, text).unwrap();
}

#[test]
#[ignore = "for bench/many_inputs.py: LACUNA_RUNS=FOLDER cargo test -p lacuna-plugins --lib -- --ignored runs_of_many_inputs"]
fn runs_of_many_inputs() {
    let folder = PathBuf::from(std::env::var_os("LACUNA_RUNS").expect("LACUNA_RUNS is a folder"));
    for (function, sizes) in &cases() {
        let name: String = function.name.chars().filter(char::is_ascii_alphanumeric).collect();
        let law = if matches!(function.designs[0], Distribution::Normal(_)) { "n" } else { "u" };
        for &runs in *sizes {
            for seed in [1, 2] {
                let case = Case::new(function, runs, seed);
                export(
                    &folder.join(format!("{name}-{law}-{runs}-{seed}.csv")),
                    function,
                    &case.points,
                );
                export(&folder.join(format!("{name}-{law}-new.csv")), function, &case.fresh);
                // Half as many runs, for gradients that cost as much as a run.
                let half = Case::new(function, runs / 2, seed);
                export(
                    &folder.join(format!("{name}-{law}-{runs}-{seed}-half.csv")),
                    function,
                    &half.points,
                );
            }
        }
    }
}

#[test]
#[ignore = "takes a minute: cargo test -p lacuna-plugins --lib -- --ignored --nocapture errors_of_many_inputs"]
fn errors_of_many_inputs() {
    let plain = PolynomialChaos {
        q_norm: Some(QNorm::Fixed(1.0)),
        max_interaction: Some(100),
        max_terms: Some(6000),
        ..PolynomialChaos::default()
    };
    let folds = PolynomialChaos { selection: Selection::KFold(10), ..PolynomialChaos::default() };
    let surrogates: [(&str, Box<dyn Surrogate>); 4] = [
        ("expansion", Box::new(PolynomialChaos::default())),
        ("expansion, total degree", Box::new(plain)),
        ("expansion, ten folds", Box::new(folds)),
        ("Gaussian process", Box::new(GaussianProcess::default())),
    ];
    println!("relative error at 2000 new points (stated error; seconds), for two designs");
    for (function, sizes) in &cases() {
        for &runs in *sizes {
            for (name, surrogate) in &surrogates {
                let mut line = format!("{}, {runs} runs, {name}:", function.name);
                for seed in [1, 2] {
                    let case = Case::new(function, runs, seed);
                    let start = Instant::now();
                    let emulator = case.fit(&**surrogate);
                    let seconds = start.elapsed().as_secs_f64();
                    let stated = emulator.fit_error().relative[0];
                    let error = case.error(&*emulator);
                    line += &format!("  {error:.2e} ({stated:.2e}; {seconds:.2})");
                }
                println!("{line}");
            }
        }
    }
}
