//! Speed of the posterior: `cargo run --release -p lacuna-bench --bin likelihood [-- DEGREE [RANK]]`.
//!
//! A problem of the founding study's size (1000 outputs, 20 replicates, an expansion in three parameters, an emulator's
//! error with some hundred directions), evaluated at the walkers of half a step. Prints one line of JSON: evaluations
//! per second of processor time, operations per evaluation, and a comparison with a product of large matrices on the
//! same machine.

use std::error::Error;
use std::hint::black_box;

use lacuna::data::{Axis, Layout, Layouts, Measurements, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::discrepancy::{CommonError, Discrepancy, ErrorOrigin, Known};
use lacuna::plugin::surrogate::{Surrogate, Training};
use lacuna::plugin::{Emulator, Target};
use lacuna::run::{Progress, Silent};
use lacuna_bench::clock::{per_call, processor_seconds};
use lacuna_engine::posterior::{OfData, Posterior};
use lacuna_linalg::{Matrix, multiply};
use lacuna_plugins::discrepancies::gaussian::Gaussian;
use lacuna_plugins::surrogates::polynomial_chaos::{Degree, PolynomialChaos, Solver};
use serde_json::json;

type Fallible<T> = Result<T, Box<dyn Error>>;

const OUTPUTS: usize = 1000;
const REPLICATES: usize = 20;
const WALKERS: usize = 60;
const BOX: [[f64; 2]; 3] = [[0.0, 1e6], [1e4, 1.36e4], [1200.0, 2200.0]];
/// Standard deviation between the replicates.
const NOISE: f64 = 5e-6;

fn main() -> Fallible<()> {
    let mut arguments = std::env::args().skip(1);
    let degree: usize = arguments.next().map_or(Ok(17), |text| text.parse())?;
    let rank: usize = arguments.next().map_or(Ok(420), |text| text.parse())?;
    let (parameters, layout) = (parameters()?, layout()?);
    let layouts = Layouts::from(layout);
    let emulator = emulator(&parameters, &layouts, degree)?;
    let data = measured(&*emulator, &layouts.blocks[0]);
    let gaussian = Gaussian {
        variance: Distribution::HalfNormal(1e-6).into(),
        by: lacuna_plugins::discrepancies::common::By::default(),
        marginal: false,
    };
    let likelihood = gaussian.likelihood(&Known::without_slopes(&data, &error(rank)))?;
    let begun = processor_seconds()?;
    let posterior = Posterior::new(&parameters, OfData::new(&*emulator, Vec::new(), &*likelihood));
    let preparation = processor_seconds()? - begun;
    let walkers = posterior.coordinates_of(&points(WALKERS, 4));

    let terms = emulator.linear().map_or(0, |linear| linear.coefficients().rows());
    let seconds = per_call(|| drop(black_box(posterior.log_density(&walkers))))? / WALKERS as f64;
    let gradient = per_call(|| drop(black_box(posterior.gradient(walkers.row(0)))))?;
    // The product with the directions, the square as a polynomial of twice the degree, the basis itself.
    let squares = (2 * degree + 1) * (2 * degree + 2) * (2 * degree + 3) / 6;
    let basis = if rank > 0 { 3 * terms } else { 0 };
    let flops = (2 * rank * (terms + 1) + 2 * squares + basis) as f64;
    let speed = flops / seconds / 1e9;
    let peak = product_speed()?;
    let line = json!({
        "outputs": OUTPUTS, "replicates": REPLICATES, "terms": terms, "rank": rank,
        "evaluations_per_cpu_second": (1.0 / seconds).round(),
        "cpu_seconds_of_144000": 144_000.0 * seconds,
        "cpu_seconds_of_preparation": preparation,
        "cpu_microseconds_of_a_gradient": 1e6 * gradient,
        "flops_per_evaluation": flops,
        "flops_without_compression": (2 * OUTPUTS * (terms + 1) + 2 * rank * OUTPUTS) as f64,
        "gigaflops": speed,
        "gigaflops_of_a_large_product": peak,
        "share_of_that": speed / peak,
    });
    println!("{line}");
    Ok(())
}

/// Walkers at these parameters, with variances around that of the noise.
trait Coordinates {
    fn coordinates_of(&self, theta: &Matrix) -> Matrix;
}

impl Coordinates for Posterior<'_> {
    fn coordinates_of(&self, theta: &Matrix) -> Matrix {
        let rows: Vec<Vec<f64>> = (theta.iter_rows().enumerate())
            .map(|(k, x)| {
                let variance = NOISE * NOISE * (1.0 + k as f64 / WALKERS as f64);
                self.coordinates(&[x, &[variance]].concat())
            })
            .collect();
        Matrix::from_rows(4, rows.iter().map(|row| &row[..]))
    }
}

/// Strain of a damped wave that arrives at each sensor at a different time.
fn response(theta: &[f64]) -> Vec<f64> {
    let [cutoff, density, speed] = [theta[0] / 1e6, theta[1] / 1e4, theta[2] / 1e3];
    let strain = |k: usize| {
        let (sensor, time) = ((k / 100) as f64, (k % 100) as f64 / 100.0);
        let since = time - 0.05 * sensor / speed;
        let envelope = 1.0 / (1.0 + (-40.0 * since).exp()) * (-since * (2.0 + cutoff)).exp();
        1e-4 * density * envelope * ((9.0 + sensor) * speed * since / density).sin()
    };
    (0..OUTPUTS).map(strain).collect()
}

fn points(count: usize, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).generator();
    Matrix::from_fn(count, 3, |_, i| BOX[i][0] + uniform(&mut rng) * (BOX[i][1] - BOX[i][0]))
}

fn parameters() -> Fallible<Vec<Parameter>> {
    let parameter = |(i, range): (usize, &[f64; 2])| {
        Ok(Parameter {
            name: format!("x{i}"),
            symbol: format!("x{i}"),
            unit: Unit::parse("1")?,
            design: Distribution::Uniform(*range),
            prior: Distribution::Uniform(*range),
            reference: None,
        })
    };
    BOX.iter().enumerate().map(parameter).collect()
}

fn layout() -> Fallible<Layout> {
    let grid = (0..OUTPUTS).map(|i| i as f64).collect();
    let axes = vec![Axis::grid("time", grid, Unit::parse("s")?)];
    Ok(Layout { name: "strain".into(), unit: Unit::parse("1")?, axes })
}

/// All terms up to a degree, fitted to 1.5 times as many runs.
fn emulator(
    parameters: &[Parameter],
    layouts: &Layouts,
    degree: usize,
) -> Fallible<Box<dyn Emulator>> {
    let terms = (degree + 1) * (degree + 2) * (degree + 3) / 6;
    let runs = points(terms + terms / 2, 1);
    let responses = Matrix::from_rows(OUTPUTS, runs.iter_rows().map(response));
    let options = PolynomialChaos {
        solver: Solver::LeastSquares,
        degree: Degree::Fixed(degree),
        ..PolynomialChaos::default()
    };
    let training =
        Training { parameters, layouts, points: &runs, responses: &responses, gradients: None };
    Ok(options.fit(&training, &Stream::root(2), &Progress::new(&Silent))?)
}

fn measured(emulator: &dyn Emulator, layout: &Layout) -> Measurements {
    let truth = emulator.mean(&Matrix::from_rows(3, [&[4e5, 1.1e4, 1500.0][..]]));
    let replicate = |r: usize| {
        let mut rng = Stream::root(3).at(r as u64).generator();
        let values = truth.row(0).iter().map(|m| Some(m + NOISE * normal(&mut rng))).collect();
        Replicate::new(r.to_string(), values)
    };
    let replicates = (0..REPLICATES).map(replicate).collect();
    Measurements::new(layout.clone(), replicates)
}

/// An emulator's error in `rank` directions, in total a fifth of the noise.
fn error(rank: usize) -> Vec<CommonError> {
    let mut rng = Stream::root(5).generator();
    let scale = 0.2 * NOISE / (rank.max(1) as f64).sqrt();
    let factor = Matrix::from_fn(OUTPUTS, rank, |_, _| scale * normal(&mut rng));
    let error =
        CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true };
    if rank == 0 { Vec::new() } else { vec![error] }
}

/// Operations per second, in 10^9, of a product of large matrices on one thread.
fn product_speed() -> Fallible<f64> {
    let size = 1000;
    let matrix =
        |phase: f64| Matrix::from_fn(size, size, |i, j| ((i * 7 + j) as f64 + phase).sin());
    let (a, b) = (matrix(0.0), matrix(1.0));
    let seconds = per_call(|| drop(black_box(multiply(&a, &b))))?;
    Ok(2.0 * (size as f64).powi(3) / seconds / 1e9)
}
