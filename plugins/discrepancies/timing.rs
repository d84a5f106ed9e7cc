//! Times of one evaluation at the founding study's size: run with `--ignored --nocapture`.
#![allow(clippy::unwrap_used)]

use std::time::Instant;

use lacuna::data::{Axis, Layout, Measurements, Replicate, Scenario, Unit};
use lacuna::linalg::Matrix;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{CommonError, Known};
use lacuna::plugin::surrogate::Linear;
use lacuna::plugin::{Discrepancy, registry};

const SENSORS: usize = 10;
const TIMES: usize = 100;
const OUTPUTS: usize = SENSORS * TIMES;
const TERMS: usize = 165;

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

fn data() -> Measurements {
    let times = (1..=TIMES).map(|j| 1e-5 * j as f64).collect();
    let sensors: Vec<String> = (0..SENSORS).map(|s| format!("S{s}")).collect();
    let layout = Layout {
        name: "strain".into(),
        unit: Unit::dimensionless(),
        axes: vec![
            Axis::labels("sensor", sensors),
            Axis::grid("time", times, Unit::parse("s").unwrap()),
        ],
    };
    let replicate = |r: u64| Replicate {
        name: r.to_string(),
        scenario: Scenario::default(),
        values: random(1, OUTPUTS, 1.0, 100 + r).row(0).iter().map(|y| Some(*y)).collect(),
    };
    Measurements { layout, replicates: (0..20).map(replicate).collect() }
}

/// Microseconds of one call, the least of forty rounds.
fn microseconds(count: usize, mut act: impl FnMut()) -> f64 {
    let round = |act: &mut dyn FnMut()| {
        let begin = Instant::now();
        (0..count).for_each(|_| act());
        1e6 * begin.elapsed().as_secs_f64() / count as f64
    };
    (0..40).map(|_| round(&mut act)).fold(f64::INFINITY, f64::min)
}

#[test]
#[ignore = "a measurement, not a test"]
fn one_evaluation() {
    let data = data();
    let factor = random(OUTPUTS, 30, 0.1, 2);
    let common = [CommonError { origin: "emulator".into(), factor, predictive: true }];
    let slopes = || Ok(random(OUTPUTS, 3, 1.0, 3));
    let known = Known { data: &data, common: &common, slopes: &slopes };
    let free = Known { common: &[], ..known };
    let prior = "{ half_normal = 1 }";
    let windows = "by = [\"sensor\", { axis = \"time\", windows = 5 }]";
    let process = format!("bias = {prior}\ncorrelation_length = {prior}\nvariance = {prior}");
    let cases = [
        ("gaussian", format!("variance = {prior}")),
        ("gaussian", format!("variance = {prior}\nmarginal = true")),
        ("gaussian", format!("variance = {prior}\nby = \"sensor\"")),
        ("gaussian", format!("variance = {prior}\n{windows}")),
        ("multiplicative_gaussian", format!("relative = {prior}\nfloor = {prior}")),
        ("student_t", format!("scale = {prior}\nby = \"sensor\"")),
        ("autoregressive", format!("variance = {prior}\ncorrelation_time = {prior}")),
        ("gaussian_process", process.clone()),
        ("gaussian_process", format!("{process}\northogonal = false")),
    ];
    let emulated = Emulated(random(TERMS, OUTPUTS, 0.1, 4));
    let basis = random(30, TERMS, 1.0, 5);
    let response = random(1, OUTPUTS, 1.0, 6);
    for (name, options) in cases {
        for (label, known) in [("rank 30", &known), ("rank 0", &free)] {
            let plugin = registry::from_text::<dyn Discrepancy>(name, &options).unwrap().plugin;
            let likelihood = plugin.likelihood(known).unwrap();
            let hyper: Vec<f64> = likelihood.hyperparameters().iter().map(|h| h.start).collect();
            let m = response.row(0);
            let full = microseconds(2, || {
                std::hint::black_box(likelihood.log_likelihood(m, &hyper));
            });
            let gradient = microseconds(1, || {
                std::hint::black_box(likelihood.gradient(m, &hyper));
            });
            let compressed = likelihood.compress(&emulated).map(|compressed| {
                let hyper = Matrix::from_rows(hyper.len(), (0..30).map(|_| &hyper[..]));
                let batch = microseconds(1, || {
                    std::hint::black_box(compressed.log_likelihood(&basis, &hyper));
                });
                format!(", compressed {:.1}", batch / 30.0)
            });
            let compressed = compressed.unwrap_or_default();
            let text = options.replace('\n', ", ");
            println!(
                "{name} {text}, {label}: value {full:.1} us, gradient {gradient:.1}{compressed}"
            );
        }
    }
}
