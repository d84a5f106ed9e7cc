//! The mutual information of a hypothesis and data that are normal under each hypothesis.

use lacuna::math::random::{Stream, normal};
use lacuna_linalg::{Cholesky, Matrix, multiply, thin_qr};
use rayon::prelude::*;

/// Number of simulated data sets of each hypothesis.
const DRAWS: u64 = 2000;

/// New data under a hypothesis, in coordinates in which their noise is independent with variance one.
pub(super) struct Predicted {
    /// The expected data, less a reference that all hypotheses share, one value an output.
    pub mean: Vec<f64>,
    /// The derivatives by the unknowns, `unknowns x outputs`.
    pub slopes: Matrix,
    /// The posterior precision of the unknowns, `unknowns x unknowns`.
    pub precision: Matrix,
}

/// A Monte Carlo estimate in bits.
pub(super) struct Bits {
    /// The estimate.
    pub value: f64,
    /// The standard error of the estimate.
    pub error: f64,
}

/// A normal density of few dimensions.
struct Density {
    mean: Vec<f64>,
    factor: Cholesky,
}

impl Density {
    fn log(&self, at: &[f64]) -> f64 {
        let off: Vec<f64> = at.iter().zip(&self.mean).map(|(x, m)| x - m).collect();
        -0.5 * (self.factor.quadratic(&off) + self.factor.log_determinant())
    }
}

/// The mutual information of hypothesis and data, `sum_k w_k E_k log2(p_k / sum_j w_j p_j)`, each expectation over data
/// simulated under its hypothesis. The densities have closed forms, so that one average is left (Box and Hill,
/// Technometrics 9 (1967) 57; Rainforth et al., Statistical Science 39 (2024) 100). `None` if a density does not exist.
pub(super) fn name_bits(weights: &[f64], all: &[Predicted], stream: &Stream) -> Option<Bits> {
    if all.len() < 2 {
        return Some(Bits { value: 0.0, error: 0.0 });
    }
    let densities = reduced(all)?;
    let mut total = Bits { value: 0.0, error: 0.0 };
    for (k, own) in densities.iter().enumerate() {
        let gains: Vec<f64> = (0..DRAWS)
            .into_par_iter()
            .map(|draw| {
                let mut rng = stream.at(k as u64).at(draw).generator();
                let z: Vec<f64> = own.mean.iter().map(|_| normal(&mut rng)).collect();
                let noise = own.factor.colour(&z);
                let data: Vec<f64> = own.mean.iter().zip(noise).map(|(m, e)| m + e).collect();
                gain(weights, &densities, k, &data)
            })
            .collect();
        let mean = gains.iter().sum::<f64>() / DRAWS as f64;
        let square = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>();
        total.value += weights[k] * mean;
        total.error += weights[k].powi(2) * square / (DRAWS as f64 * (DRAWS - 1) as f64);
    }
    Some(Bits { value: total.value.max(0.0), error: total.error.sqrt() })
}

/// The gain in the log probability of hypothesis `k` by data, in bits.
fn gain(weights: &[f64], densities: &[Density], k: usize, data: &[f64]) -> f64 {
    let logs: Vec<f64> = densities.iter().map(|density| density.log(data)).collect();
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = weights.iter().zip(&logs).map(|(w, l)| w * (l - most).exp()).sum();
    (logs[k] - most - sum.ln()) / std::f64::consts::LN_2
}

/// The densities in the span of all means and slopes: elsewhere the hypotheses agree.
fn reduced(all: &[Predicted]) -> Option<Vec<Density>> {
    let rows = all
        .iter()
        .flat_map(|own| std::iter::once(own.mean.as_slice()).chain(own.slopes.iter_rows()))
        .map(unit);
    let span = Matrix::from_rows(all[0].mean.len(), rows);
    let basis = thin_qr(&span.transposed()).ok()?.q;
    let one = |own: &Predicted| {
        let mean = multiply(&Matrix::from_rows(own.mean.len(), [own.mean.clone()]), &basis);
        let slopes = multiply(&own.slopes, &basis);
        let spread = Cholesky::new(&own.precision).ok()?.whiten_matrix(&slopes);
        let mut covariance = lacuna_linalg::gram(&spread);
        (0..covariance.rows()).for_each(|j| covariance[(j, j)] += 1.0);
        Some(Density { mean: mean.into_vec(), factor: Cholesky::new(&covariance).ok()? })
    };
    all.iter().map(one).collect()
}

/// A vector scaled to length one; zero stays.
fn unit(row: &[f64]) -> Vec<f64> {
    let length = row.iter().map(|x| x * x).sum::<f64>().sqrt();
    row.iter().map(|x| if length > 0.0 { x / length } else { 0.0 }).collect()
}
