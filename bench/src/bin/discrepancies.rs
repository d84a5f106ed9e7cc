//! Speed of each discrepancy: `cargo run --release -p lacuna-bench --bin discrepancies [-- RANK [WORD]]`.
//!
//! Ten sensors with a hundred times, twenty replicates, three parameters, `RANK` directions of common errors (default:
//! 30): the founding study's size. Prints one line of JSON for each discrepancy whose name and options contain `WORD`:
//! microseconds of processor time for the density, for the density with its gradient, and for both in the compressed
//! form, if there is one.

use std::error::Error;
use std::hint::black_box;

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, Known};
use lacuna::plugin::forward::Linear;
use lacuna::plugin::{Discrepancy, registry};
use lacuna_bench::clock::per_call;
use lacuna_linalg::Matrix;
use lacuna_plugins as _;
use serde_json::{Value, json};

type Fallible<T> = Result<T, Box<dyn Error>>;

const SENSORS: usize = 10;
const TIMES: usize = 100;
const OUTPUTS: usize = SENSORS * TIMES;
const REPLICATES: u64 = 20;
const TERMS: usize = 165;
const POINTS: usize = 30;

fn main() -> Fallible<()> {
    let mut arguments = std::env::args().skip(1);
    let rank: usize = arguments.next().map_or(Ok(30), |text| text.parse())?;
    let word = arguments.next().unwrap_or_default();
    let data = data()?;
    let factor = random(OUTPUTS, rank, 0.1, 2);
    let error =
        [CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true }];
    let slopes = || Ok(random(OUTPUTS, 3, 1.0, 3));
    let common = if rank > 0 { &error[..] } else { &[] };
    let known = Known { data: &data, common, slopes: &slopes, parameters: &[] };
    for (name, options) in cases() {
        let title = format!("{name}: {}", options.replace('\n', ", "));
        if title.contains(&word) {
            println!("{}", measure(&title, name, &options, &known)?);
        }
    }
    Ok(())
}

fn cases() -> Vec<(&'static str, String)> {
    let prior = "{ half_normal = 1 }";
    let windows = "by = [\"sensor\", { axis = \"time\", windows = 5 }]";
    let process = format!("bias = {prior}\ncorrelation_length = {prior}\nvariance = {prior}");
    let series = format!("variance = {prior}\ncorrelation_time = {prior}");
    vec![
        ("gaussian", format!("variance = {prior}")),
        ("gaussian", format!("variance = {prior}\nmarginal = true")),
        ("gaussian", format!("variance = {prior}\nby = \"sensor\"")),
        ("gaussian", format!("variance = {prior}\n{windows}")),
        ("multiplicative_gaussian", format!("relative = {prior}\nfloor = {prior}")),
        ("student_t", format!("scale = {prior}\nby = \"sensor\"")),
        ("autoregressive", series),
        ("gaussian_process", format!("{process}\nby = \"sensor\"")),
        ("gaussian_process", format!("{process}\northogonal = false")),
    ]
}

fn measure(title: &str, name: &str, options: &str, known: &Known<'_>) -> Fallible<Value> {
    let plugin = registry::from_text::<dyn Discrepancy>(name, options)?.plugin;
    let likelihood = plugin.likelihood(known).map_err(|stop| stop.to_string())?;
    let hyper: Vec<f64> = likelihood.hyperparameters().iter().map(|h| h.start).collect();
    let response = random(1, OUTPUTS, 1.0, 6);
    let m = response.row(0);
    let density = per_call(|| {
        black_box(likelihood.log_likelihood(m, &hyper));
    })?;
    let gradient = per_call(|| drop(black_box(likelihood.gradient(m, &hyper))))?;
    let mut line = json!({
        "discrepancy": title, "directions": known.common.iter().map(|e| e.factor.columns()).sum::<usize>(),
        "unknowns": hyper.len(), "microseconds": 1e6 * density,
        "microseconds_of_a_gradient": 1e6 * gradient,
    });
    let emulated = Emulated(random(TERMS, OUTPUTS, 0.1, 4));
    if let Some(compressed) = likelihood.compress(&emulated) {
        let basis = random(POINTS, TERMS, 1.0, 5);
        let rows = Matrix::from_rows(hyper.len(), (0..POINTS).map(|_| &hyper[..]));
        let density = per_call(|| drop(black_box(compressed.log_likelihood(&basis, &rows))))?;
        let gradient = per_call(|| drop(black_box(compressed.gradient(basis.row(0), &hyper))))?;
        line["microseconds_compressed"] = json!(1e6 * density / POINTS as f64);
        line["microseconds_of_a_gradient_compressed"] = json!(1e6 * gradient);
    }
    Ok(line)
}

/// An emulator whose basis functions are the inputs.
struct Emulated(Matrix);

impl Linear for Emulated {
    fn coefficients(&self) -> &Matrix {
        &self.0
    }
    fn basis(&self, points: &Matrix) -> Matrix {
        points.clone()
    }
    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        Matrix::from_fn(point.len(), point.len(), |i, j| f64::from(u8::from(i == j)))
    }
}

fn random(rows: usize, columns: usize, size: f64, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).generator();
    Matrix::from_fn(rows, columns, |_, _| size * normal(&mut rng))
}

fn data() -> Fallible<Measurements> {
    let times = (1..=TIMES).map(|j| 1e-5 * j as f64).collect();
    let sensors: Vec<String> = (0..SENSORS).map(|s| format!("S{s}")).collect();
    let layout = Layout {
        name: "strain".into(),
        unit: Unit::dimensionless(),
        axes: vec![Axis::labels("sensor", sensors), Axis::grid("time", times, Unit::parse("s")?)],
    };
    let replicate = |r: u64| {
        Replicate::new(
            r.to_string(),
            random(1, OUTPUTS, 1.0, 100 + r).row(0).iter().map(|y| Some(*y)).collect(),
        )
    };
    Ok(Measurements::new(layout, (0..REPLICATES).map(replicate).collect()))
}
