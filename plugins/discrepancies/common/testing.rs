//! Densities computed with the dense covariance of all data, for the tests.
#![allow(clippy::unwrap_used)]

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, Likelihood};
use lacuna::plugin::{Discrepancy, registry};
use lacuna_linalg::{Cholesky, Matrix};

pub const SENSORS: usize = 3;
pub const TIMES: usize = 6;
pub const OUTPUTS: usize = SENSORS * TIMES;

pub fn layout() -> Layout {
    // An uneven grid.
    let times = (0..TIMES).map(|j| 1e-4 * (j as f64 + 0.1 * (j * j) as f64)).collect();
    Layout {
        name: "strain".into(),
        unit: Unit::parse("1").unwrap(),
        axes: vec![
            Axis::labels("sensor", ["B", "C", "G"]),
            Axis::grid("time", times, Unit::parse("s").unwrap()),
        ],
    }
}

/// Unequal replicates with gaps; output 4 and the whole last window of sensor G are never measured.
pub fn data(seed: u64, replicates: usize) -> Measurements {
    let mut rng = Stream::root(seed).generator();
    let replicate = |r: usize, rng: &mut _| {
        Replicate::new(
            r.to_string(),
            (0..OUTPUTS)
                .map(|i| {
                    let y = normal(rng) * (1.0 + (i / TIMES) as f64) + (i as f64).sin();
                    let kept = r == 0 || uniform(rng) < 0.7;
                    (i != 4 && i < OUTPUTS - 2 && kept).then_some(y)
                })
                .collect(),
        )
    };
    Measurements::new(layout(), (0..replicates).map(|r| replicate(r, &mut rng)).collect())
}

pub fn random_matrix(rows: usize, columns: usize, seed: u64) -> Matrix {
    let mut rng = Stream::root(seed).generator();
    Matrix::from_fn(rows, columns, |_, _| normal(&mut rng))
}

pub fn common(seed: u64) -> CommonError {
    let factor = random_matrix(OUTPUTS, 2, seed);
    CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true }
}

/// All data as one normal vector: residuals, with replicate and output of each.
pub struct Written {
    pub residual: Vec<f64>,
    pub covariance: Matrix,
}

impl Written {
    /// Builds the vector; `shared(i, j)` is the covariance of outputs common to all replicates, `own(i, j)` that
    /// within one replicate.
    pub fn new(
        data: &Measurements,
        response: &[f64],
        shared: impl Fn(usize, usize) -> f64,
        own: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let mut residual = Vec::new();
        let mut place = Vec::new();
        for (r, replicate) in data.replicates.iter().enumerate() {
            for (i, value) in replicate.values.iter().enumerate() {
                if let Some(y) = value {
                    residual.push(y - response[i]);
                    place.push((r, i));
                }
            }
        }
        let covariance = Matrix::from_fn(place.len(), place.len(), |a, b| {
            let ((r, i), (s, j)) = (place[a], place[b]);
            shared(i, j) + if r == s { own(i, j) } else { 0.0 }
        });
        Self { residual, covariance }
    }

    pub fn log_density(&self) -> f64 {
        let factor = Cholesky::new(&self.covariance).unwrap();
        let own = self.residual.len() as f64 * std::f64::consts::TAU.ln();
        -0.5 * (own + factor.log_determinant() + factor.quadratic(&self.residual))
    }

    /// Returns `log p(y) - log p(y without i)` for each `i`.
    pub fn left_out(&self) -> Vec<f64> {
        let all = self.log_density();
        let n = self.residual.len();
        let without = |i: usize| {
            let kept: Vec<usize> = (0..n).filter(|&k| k != i).collect();
            Self {
                residual: kept.iter().map(|&k| self.residual[k]).collect(),
                covariance: self.covariance.select_rows(&kept).select_columns(&kept),
            }
        };
        (0..n).map(|i| all - without(i).log_density()).collect()
    }
}

/// Returns `F F'` of all common errors.
pub fn shared(common: &[CommonError]) -> impl Fn(usize, usize) -> f64 {
    move |i, j| {
        let of = |e: &CommonError| -> f64 {
            e.factor.row(i).iter().zip(e.factor.row(j)).map(|(x, y)| x * y).sum()
        };
        common.iter().map(of).sum()
    }
}

pub fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance * expected.abs().max(1e-3), "{found} {expected}");
}

/// Asserts that gradients agree with central differences, whose own error is of the order of `h^2` times the third
/// derivative.
pub fn has_its_derivatives(likelihood: &dyn Likelihood, response: &[f64], hyper: &[f64]) {
    let (by_response, by_hyper) = likelihood.gradient(response, hyper);
    let difference = |f: &dyn Fn(f64) -> f64, h: f64| (f(h) - f(-h)) / (2.0 * h);
    for (i, g) in by_response.iter().enumerate() {
        let at = |h: f64| {
            let mut moved = response.to_vec();
            moved[i] += h;
            likelihood.log_likelihood(&moved, hyper)
        };
        let expected = difference(&at, 1e-5);
        assert!((g - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{i}: {g} {expected}");
    }
    for (j, g) in by_hyper.iter().enumerate() {
        let at = |h: f64| {
            let mut moved = hyper.to_vec();
            moved[j] += h;
            likelihood.log_likelihood(response, &moved)
        };
        let expected = difference(&at, 1e-5 * hyper[j].abs().max(1e-2));
        assert!((g - expected).abs() < 1e-6 * (1.0 + expected.abs()), "hyper {j}: {g} {expected}");
    }
}

/// Parses the options of a plugin as written in a study.
pub fn options<T: serde::de::DeserializeOwned>(name: &str, text: &str) -> Result<T, String> {
    let built = registry::from_text::<dyn Discrepancy>(name, text)?;
    let json = serde_json::to_value(&built.options).map_err(|e| e.to_string())?;
    serde_json::from_value(json).map_err(|e| e.to_string())
}
