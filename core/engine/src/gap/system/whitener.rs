//! Whitening: differences from the replicates' mean in units of their standard deviation under noise and model errors.
//!
//! The covariance of the mean over `R` replicates is `S / R + K`: noise of one replicate over their number, and the
//! covariance of the emulator's error, which all replicates share. `S` consists of random effects of whole replicates
//! (of low rank) and of autoregressions along the curves, so that whitening takes one pass over the curves and one
//! product with a thin matrix.

use lacuna::plugin::discrepancy::CommonError;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{
    Cholesky, Matrix, multiply, multiply_transposed, multiply_vector, solve_lower_matrix,
    symmetric_eigen, transposed_multiply, transposed_multiply_vector,
};

use super::noise_scale::NoiseScale;
use crate::gap::experiment::Experiment;
use crate::gap::noise::{Noise, Succession, directions};

/// Directions of a whitened covariance with less than this share of the variance of the white noise are dropped.
const NEGLIGIBLE: f64 = 1e-6;

/// Whitens differences from the replicates' mean.
#[derive(Debug, Clone)]
pub struct Whitener {
    curves: Vec<CurveWhitener>,
    /// The curves of each condition with the lower factor of their correlation.
    across: Vec<(std::ops::Range<usize>, Matrix)>,
    outputs: usize,
    /// The uncertainty of the size of the noise.
    pub noise_scale: NoiseScale,
    /// The share of independent errors in the variance of each output, without the part of low rank.
    independent: Vec<f64>,
    /// Parts of low rank, one on top of the other: random effects and known errors, then a remainder.
    low_rank: Vec<LowRank>,
}

#[derive(Debug, Clone)]
struct CurveWhitener {
    measured: Vec<usize>,
    /// The inverse of the standard deviation of the innovations of the mean with independent errors, one per measured value.
    scale: Vec<f64>,
    succession: Succession,
}

/// A whitener of `I + U U'`, `I - left right'`.
#[derive(Debug, Clone)]
struct LowRank {
    /// `outputs x directions`.
    left: Matrix,
    /// `outputs x directions`.
    right: Matrix,
    /// The log of its determinant.
    log_determinant: f64,
}

/// The form of the part of low rank.
#[derive(Debug, Clone, Copy)]
enum Root {
    /// The symmetric root, which changes each value as little as possible.
    Symmetric,
    /// The root by Cholesky's method.
    Triangular,
}

impl Whitener {
    /// The whitener of the mean over the replicates of an experiment, with this noise around a response (one value per
    /// output).
    pub fn new(experiment: &Experiment<'_>, noise: &Noise, response: &[f64]) -> Self {
        Self::of_counts(experiment, noise, response, &experiment.means().0)
    }

    /// As [`Whitener::new`], up to a rotation: for lengths, products and determinants alone. It needs no eigenvectors.
    pub fn rotated(experiment: &Experiment<'_>, noise: &Noise, response: &[f64]) -> Self {
        Self::build(experiment, noise, response, &experiment.means().0, Root::Triangular)
    }

    /// The whitener of means over other numbers of replicates, one per output.
    pub fn of_counts(
        experiment: &Experiment<'_>,
        noise: &Noise,
        response: &[f64],
        counts: &[f64],
    ) -> Self {
        Self::build(experiment, noise, response, counts, Root::Symmetric)
    }

    fn build(
        experiment: &Experiment<'_>,
        noise: &Noise,
        response: &[f64],
        counts: &[f64],
        root: Root,
    ) -> Self {
        let mut independent = vec![0.0; experiment.outputs()];
        let mut curves = Vec::new();
        for (curve, law) in experiment.curves.iter().zip(&noise.curves) {
            let mut scale = Vec::new();
            for (&i, w) in curve.measured.iter().zip(&law.profile) {
                let rest = experiment.independent.get(i).copied().unwrap_or(0.0);
                let variance = (law.sd * w).powi(2) / counts[i] + rest;
                scale.push(1.0 / variance.sqrt());
                independent[i] = rest / variance;
            }
            let (measured, succession) = (curve.measured.clone(), law.succession(curve));
            curves.push(CurveWhitener { measured, scale, succession });
        }
        let conditions = experiment.conditions.iter().zip(&noise.across);
        let across = conditions
            .filter_map(|(condition, factor)| Some((condition.curves.clone(), factor.clone()?)))
            .collect();
        let outputs = experiment.outputs();
        let noise_scale = NoiseScale::of(experiment, noise);
        let mut whitener =
            Self { curves, across, outputs, noise_scale, independent, low_rank: Vec::new() };
        let mut spread = wander(experiment, noise, response, counts);
        spread.extend(experiment.common.iter().flat_map(|error| {
            (0..error.factor.columns()).map(|j| error.factor.column(j)).collect::<Vec<_>>()
        }));
        let mut columns: Vec<Vec<f64>> = spread.iter().map(|u| whitener.base(u)).collect();
        columns.retain(|u| dot(u, u) > NEGLIGIBLE);
        whitener.low_rank.extend(LowRank::of(&columns, outputs, root));
        whitener
    }

    /// Whitens differences in the response's unit, one per output: the result is independent with variance one under
    /// noise and model errors, and zero if nothing was measured.
    pub fn whiten(&self, differences: &[f64]) -> Vec<f64> {
        let mut white = self.base(differences);
        for low_rank in &self.low_rank {
            let along = transposed_multiply_vector(&low_rank.right, &white);
            let taken = multiply_vector(&low_rank.left, &along);
            white.iter_mut().zip(taken).for_each(|(w, t)| *w -= t);
        }
        white
    }

    /// Whitens each row of a matrix `rows x outputs`.
    pub fn whiten_rows(&self, rows: &Matrix) -> Matrix {
        let base = rows.iter_rows().map(|row| self.base(row));
        let mut white = Matrix::from_rows(self.outputs, base);
        let parts = self.low_rank.iter();
        parts.for_each(|part| take_rows(&mut white, &part.left, &part.right));
        white
    }

    /// This whitener with a further covariance `Q diag(variances) Q'` of whitened differences, `Q` being orthonormal
    /// rows, `directions x outputs`.
    pub fn with(&self, directions: &Matrix, variances: &[f64]) -> Self {
        let mut other = self.clone();
        other.low_rank.push(LowRank::symmetric(directions.transposed(), variances));
        other
    }

    /// The variance of the product of each whitened row with the independent part of the emulator's error.
    pub fn of_independent(&self, rows: &Matrix) -> Vec<f64> {
        let mut seen = rows.clone();
        let parts = self.low_rank.iter().rev();
        parts.for_each(|part| take_rows(&mut seen, &part.right, &part.left));
        let one = |row: &[f64]| row.iter().zip(&self.independent).map(|(x, r)| x * x * r).sum();
        seen.iter_rows().map(one).collect()
    }

    /// The inverse of the standard deviation of the innovations of the mean at each output, in the inverse of the
    /// response's unit; zero if nothing was measured.
    pub fn scale(&self) -> Vec<f64> {
        let mut all = vec![0.0; self.outputs];
        for curve in &self.curves {
            curve.measured.iter().zip(&curve.scale).for_each(|(&i, s)| all[i] = *s);
        }
        all
    }

    /// The logarithm of the determinant of [`Whitener::whiten`] on the measured values.
    pub fn log_determinant(&self) -> f64 {
        let curves = self.curves.iter().map(|curve| {
            let scales = curve.scale.iter().map(|s| s.ln()).sum::<f64>();
            scales + curve.succession.log_determinant()
        });
        let across = self.across.iter().map(|(curves, factor)| {
            let length = self.curves[curves.start].measured.len() as f64;
            -length * (0..factor.rows()).map(|i| factor[(i, i)].ln()).sum::<f64>()
        });
        let low_rank = self.low_rank.iter().map(|part| part.log_determinant).sum::<f64>();
        curves.sum::<f64>() + across.sum::<f64>() + low_rank
    }

    /// Whitens rows, `rows x outputs`, with the autoregressions alone, without the part of low rank.
    pub(super) fn base_rows(&self, rows: &Matrix) -> Matrix {
        Matrix::from_rows(self.outputs, rows.iter_rows().map(|row| self.base(row)))
    }

    /// Whitening without the part of low rank.
    fn base(&self, differences: &[f64]) -> Vec<f64> {
        let mut own: Vec<Vec<f64>> = self
            .curves
            .iter()
            .map(|curve| {
                let each = curve.measured.iter().zip(&curve.scale);
                let mut values: Vec<f64> = each.map(|(&i, s)| differences[i] * s).collect();
                // Many directions are nonzero on one curve only, so curves of zeros are skipped.
                if values.iter().any(|v| *v != 0.0) {
                    curve.succession.whiten(&mut values);
                }
                values
            })
            .collect();
        for (curves, factor) in &self.across {
            let own = &mut own[curves.clone()];
            if own.iter().flatten().any(|v| *v != 0.0) {
                decorrelate(factor, own);
            }
        }
        let mut white = vec![0.0; self.outputs];
        for (curve, values) in self.curves.iter().zip(own) {
            curve.measured.iter().zip(values).for_each(|(&i, v)| white[i] = v);
        }
        white
    }
}

/// Solves with a lower factor across curves, in place.
fn decorrelate(factor: &Matrix, curves: &mut [Vec<f64>]) {
    for t in 0..curves[0].len() {
        for i in 0..curves.len() {
            let known: f64 = (0..i).map(|j| factor[(i, j)] * curves[j][t]).sum();
            curves[i][t] = (curves[i][t] - known) / factor[(i, i)];
        }
    }
}

/// The covariance of the emulator's error reduced to the principal directions that matter: those with a variance below
/// a hundredth of the noise variance are dropped.
pub fn condensed(experiment: &Experiment<'_>, noise: &Noise, response: &[f64]) -> Vec<CommonError> {
    let alone = Experiment { common: Vec::new(), ..experiment.clone() };
    let whitener = Whitener::new(&alone, noise, response);
    let condense = |error: &CommonError| {
        if error.factor.columns() == 0 {
            return error.clone();
        }
        let white = whitener.whiten_rows(&error.factor.transposed());
        let Ok(eigen) = symmetric_eigen(&multiply_transposed(&white, &white)) else {
            return error.clone();
        };
        let kept: Vec<usize> =
            (0..eigen.values.len()).filter(|&k| eigen.values[k] > 0.01).collect();
        let factor = multiply(&error.factor, &eigen.vectors.select_columns(&kept));
        CommonError { factor: factor.into(), ..error.clone() }
    };
    experiment.common.iter().map(condense).collect()
}

/// Factors of the covariance of the mean due to random effects of whole replicates, by curve and shared.
fn wander(
    experiment: &Experiment<'_>,
    noise: &Noise,
    response: &[f64],
    counts: &[f64],
) -> Vec<Vec<f64>> {
    let mut factors = Vec::new();
    for (c, condition) in experiment.conditions.iter().enumerate() {
        let mut shared = [0, 1, 2].map(|_| vec![0.0; experiment.outputs()]);
        for s in condition.curves.clone() {
            let curve = &experiment.curves[s];
            let own: Vec<f64> = curve.measured.iter().map(|&i| response[i]).collect();
            let directions = directions(&own, &curve.at);
            for (d, variance) in noise.curves[s].wander.variances().into_iter().enumerate() {
                let mut factor = vec![0.0; experiment.outputs()];
                for (&i, slope) in curve.measured.iter().zip(&directions[d]) {
                    factor[i] = (variance / counts[i]).sqrt() * slope;
                    shared[d][i] = slope / counts[i].sqrt();
                }
                if variance > 0.0 {
                    factors.push(factor);
                }
            }
        }
        for (mut factor, variance) in shared.into_iter().zip(noise.shared[c].variances()) {
            if variance > 0.0 {
                for x in &mut factor {
                    *x *= variance.sqrt();
                }
                factors.push(factor);
            }
        }
    }
    factors
}

/// Takes `left right'` of each row from it.
fn take_rows(rows: &mut Matrix, left: &Matrix, right: &Matrix) {
    let taken = multiply_transposed(&multiply(rows, right), left);
    rows.as_mut_slice().iter_mut().zip(taken.as_slice()).for_each(|(w, t)| *w -= t);
}

impl LowRank {
    /// The symmetric root `I - Q diag(1 - (1 + v)^-1/2) Q'` for orthonormal directions `Q`, `outputs x directions`, and
    /// their variances `v`.
    fn symmetric(directions: Matrix, variances: &[f64]) -> Self {
        let shrink: Vec<f64> = variances.iter().map(|v| 1.0 - 1.0 / (1.0 + v).sqrt()).collect();
        let mut left = directions.clone();
        for i in 0..left.rows() {
            left.row_mut(i).iter_mut().zip(&shrink).for_each(|(x, s)| *x *= s);
        }
        let log_determinant = -0.5 * variances.iter().map(|v| v.ln_1p()).sum::<f64>();
        Self { left, right: directions, log_determinant }
    }

    /// The root `I - U (L + I)^-T L^-1 U'` with `L L' = I + U'U`, from the rows `U'`.
    fn triangular(u: &Matrix) -> Option<Self> {
        let mut inner = multiply_transposed(u, u);
        (0..inner.rows()).for_each(|k| inner[(k, k)] += 1.0);
        let factor = Cholesky::new(&inner).ok()?;
        let mut more = factor.lower().clone();
        (0..more.rows()).for_each(|k| more[(k, k)] += 1.0);
        let mut left = u.clone();
        solve_lower_matrix(&more, &mut left);
        let right = factor.whiten_matrix(u).transposed();
        let log_determinant = -0.5 * factor.log_determinant();
        Some(Self { left: left.transposed(), right, log_determinant })
    }

    /// The whitener of the columns of `U`.
    fn of(columns: &[Vec<f64>], outputs: usize, root: Root) -> Option<Self> {
        if columns.is_empty() {
            return None;
        }
        let u = Matrix::from_rows(outputs, columns);
        if matches!(root, Root::Triangular) {
            return Self::triangular(&u);
        }
        let eigen = symmetric_eigen(&multiply_transposed(&u, &u)).ok()?;
        let kept: Vec<usize> =
            (0..eigen.values.len()).filter(|&k| eigen.values[k] > NEGLIGIBLE).collect();
        if kept.is_empty() {
            return None;
        }
        let scaled = Matrix::from_fn(columns.len(), kept.len(), |i, k| {
            eigen.vectors[(i, kept[k])] / eigen.values[kept[k]].sqrt()
        });
        let variances: Vec<f64> = kept.iter().map(|&k| eigen.values[k]).collect();
        Some(Self::symmetric(transposed_multiply(&u, &scaled), &variances))
    }
}
