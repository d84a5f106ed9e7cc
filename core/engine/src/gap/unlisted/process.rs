//! The evidence and the posterior of an orthogonal Gaussian process with given hyperparameters.

use lacuna_linalg::{
    Cholesky, Matrix, multiply, multiply_transposed, multiply_vector, symmetric_eigen,
    transposed_multiply_vector,
};

use super::features::Features;

/// Lower bound of the spectral densities, as a share of the largest.
const FLOOR: f64 = 1e-10;

/// Number of amplitudes that are tried, from 0.01 to 100 times the scale.
const AMPLITUDES: usize = 41;

/// Kernel of Matérn type with smoothness 5/2, around a central frequency or around zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kernel {
    /// The correlation length.
    pub length: f64,
    /// The central angular frequency.
    pub middle: f64,
}

impl Kernel {
    /// The spectral density for variance one (Rasmussen and Williams, Gaussian Processes for Machine Learning, equation
    /// 4.15), half of it around each sign of the central frequency.
    pub fn density(&self, angular: f64) -> f64 {
        let rate = 5.0_f64.sqrt() / self.length;
        let around = |w: f64| 16.0 / 3.0 * rate.powi(5) / (rate * rate + w * w).powi(3);
        0.5 * (around(angular - self.middle) + around(angular + self.middle))
    }
}

/// A process with a given kernel, in the coordinates in which prior precision and information of the data are both
/// diagonal.
pub(super) struct Process<'a> {
    features: &'a Features,
    /// Transformation from those coordinates to the free combinations.
    basis: Matrix,
    /// Information of the data on each coordinate relative to the prior of amplitude one, and the score of the
    /// coordinate.
    pub information: Vec<f64>,
    score: Vec<f64>,
}

/// Posterior of a process.
#[derive(Debug, Clone)]
pub(super) struct ProcessPosterior {
    /// Mean and standard deviation at every output.
    pub mean: Vec<f64>,
    pub sd: Vec<f64>,
}

impl<'a> Process<'a> {
    /// The process with this kernel.
    pub fn new(features: &'a Features, shape: &Kernel) -> Option<Self> {
        let density: Vec<f64> = features.angular.iter().map(|w| shape.density(*w)).collect();
        let floor = FLOOR * density.iter().copied().fold(0.0, f64::max);
        let inverse: Vec<f64> = density.iter().map(|s| 1.0 / s.max(floor)).collect();
        let (sines, size) = (features.free.rows(), features.free.columns());
        let scaled = Matrix::from_fn(sines, size, |i, a| inverse[i].sqrt() * features.free[(i, a)]);
        let factor = Cholesky::new(&lacuna_linalg::gram(&scaled)).ok()?;
        let half = factor.whiten_matrix(&features.information).transposed();
        let eigen = symmetric_eigen(&factor.whiten_matrix(&half)).ok()?;
        let mut score = features.score.clone();
        factor.whiten(&mut score);
        Some(Self {
            features,
            score: transposed_multiply_vector(&eigen.vectors, &score),
            basis: multiply(&factor.lower_inverse().transposed(), &eigen.vectors),
            information: eigen.values.iter().map(|v| v.max(0.0)).collect(),
        })
    }

    /// The log Bayes factor against no process.
    pub fn log_evidence(&self, amplitude: f64) -> f64 {
        let square = amplitude * amplitude;
        let each = self.information.iter().zip(&self.score).map(|(l, b)| {
            let grown = square * l;
            0.5 * (square * b * b / (1.0 + grown) - grown.ln_1p())
        });
        each.sum()
    }

    /// The amplitude of largest evidence, and its log evidence.
    pub fn best(&self) -> (f64, f64) {
        let tried = (0..AMPLITUDES).map(|k| {
            let amplitude = 10f64.powf(-2.0 + 4.0 * k as f64 / (AMPLITUDES - 1) as f64);
            (amplitude, self.log_evidence(amplitude))
        });
        let first = (0.0, 0.0);
        tried.fold(first, |best, next| if next.1 > best.1 { next } else { best })
    }

    /// The part of the energy of the residual that the posterior mean with this amplitude explains, and its expectation
    /// under noise alone.
    pub fn taken(&self, amplitude: f64) -> (f64, f64) {
        let square = amplitude * amplitude;
        let each = self.information.iter().zip(&self.score);
        each.fold((0.0, 0.0), |(data, noise), (l, b)| {
            let kept = square * l / (1.0 + square * l);
            let part = kept * (2.0 - kept);
            (data + if *l > 0.0 { part * b * b / l } else { 0.0 }, noise + part)
        })
    }

    /// The posterior of the process with this amplitude.
    pub fn posterior(&self, amplitude: f64) -> ProcessPosterior {
        let square = amplitude * amplitude;
        let spread: Vec<f64> =
            self.information.iter().map(|l| square / (1.0 + square * l)).collect();
        let mean: Vec<f64> = spread.iter().zip(&self.score).map(|(s, b)| s * b).collect();
        let sines = multiply(&self.features.free, &self.basis);
        let mean = transposed_multiply_vector(&self.features.rows, &multiply_vector(&sines, &mean));
        let root =
            Matrix::from_fn(sines.rows(), sines.columns(), |i, a| sines[(i, a)] * spread[a].sqrt());
        let covariance = multiply_transposed(&root, &root);
        let rows = &self.features.rows;
        let own: Vec<Vec<usize>> = own(rows);
        let variance = |i: usize| -> f64 {
            let own = &own[i];
            let each = own.iter().map(|&a| {
                own.iter().map(|&b| rows[(a, i)] * covariance[(a, b)] * rows[(b, i)]).sum::<f64>()
            });
            each.sum()
        };
        let sd = (0..rows.columns()).map(|i| variance(i).max(0.0).sqrt()).collect();
        ProcessPosterior { mean, sd }
    }
}

/// The sines that act on each output: those of its curve.
fn own(rows: &Matrix) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new(); rows.columns()];
    for (a, row) in rows.iter_rows().enumerate() {
        for (i, x) in row.iter().enumerate() {
            if *x != 0.0 {
                all[i].push(a);
            }
        }
    }
    all
}
