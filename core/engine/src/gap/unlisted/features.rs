//! A Gaussian process over the last axis of some curves, as a few basis functions orthogonal to the slopes of the
//! parameters.
//!
//! The kernel is a sum over sines on an interval wider than the curve, weighted with its spectral density (Solin and
//! Särkkä, Statistics and Computing 30 (2020) 419). The process has no component along the slopes of the calibrated
//! unknowns in the metric of the noise (Plumlee, Journal of the American Statistical Association 112 (2017) 1274):
//! otherwise it would absorb the part of the residual that the parameters explain.

use std::f64::consts::PI;

use lacuna_linalg::vector::norm;
use lacuna_linalg::{
    Matrix, multiply, multiply_transposed, multiply_vector, symmetric_eigen, transposed_multiply,
};

use crate::gap::experiment::Experiment;
use crate::gap::system::fit::Fit;
use crate::gap::system::whitener::Whitener;

/// The interval of the sines is wider than the curve by this factor.
const WIDER: f64 = 1.25;

/// Constraints with less than this share of the largest eigenvalue are dropped.
const SMALL: f64 = 1e-10;

/// Sines on some curves, made orthogonal to the slopes.
pub(super) struct Features {
    /// The sines, one per row: `sines x outputs`, in units of the scale of each curve.
    pub rows: Matrix,
    /// The angular frequency of each sine.
    pub angular: Vec<f64>,
    /// Length and mean step of the longest curve, in the unit of the last axis.
    pub length: f64,
    pub step: f64,
    /// The combinations of sines that the slopes leave free: `sines x free`.
    pub free: Matrix,
    /// The products of the free combinations in the metric of the noise, and those with the residual.
    pub information: Matrix,
    pub score: Vec<f64>,
}

impl Features {
    /// At most `most` sines on the curves, each scaled by its curve; `None` if the slopes leave no combination free.
    pub fn new(
        experiment: &Experiment<'_>,
        fit: &Fit,
        whitener: &Whitener,
        curves: &[(usize, f64)],
        most: usize,
    ) -> Option<Self> {
        let mut rows = Matrix::zeros(0, experiment.outputs());
        let (mut angular, mut length, mut step) = (Vec::new(), 0.0_f64, f64::INFINITY);
        for &(s, scale) in curves {
            let curve = &experiment.curves[s];
            let (layout, _) = experiment.layouts.block(curve.outputs.start);
            let (_, at, _) = layout.abscissa()?;
            let (first, last) = (*at.first()?, *at.last()?);
            if at.len() != curve.outputs.len() || at.len() < 4 || last <= first {
                continue;
            }
            length = length.max(last - first);
            step = step.min((last - first) / (at.len() - 1) as f64);
            let half = 0.5 * WIDER * (last - first);
            let begin = 0.5 * (first + last) - half;
            for j in 1..=most.min(at.len()) {
                let frequency = PI * j as f64 / (2.0 * half);
                let mut row = vec![0.0; experiment.outputs()];
                for (i, t) in curve.outputs.clone().zip(at) {
                    row[i] = scale * (frequency * (t - begin)).sin() / half.sqrt();
                }
                rows.push_row(&row);
                angular.push(frequency);
            }
        }
        if angular.is_empty() {
            return None;
        }
        let white = whitener.whiten_rows(&rows);
        let free = free(&multiply_transposed(&fit.slopes, &white))?;
        let products = multiply_transposed(&white, &white);
        let information = transposed_multiply(&free, &multiply(&products, &free));
        let score = multiply_vector(&white, &fit.residual);
        let score = lacuna_linalg::transposed_multiply_vector(&free, &score);
        Some(Self { rows, angular, length, step, free, information, score })
    }
}

/// An orthonormal basis of the null space of the rows, one vector per column.
fn free(constraints: &Matrix) -> Option<Matrix> {
    let size = constraints.columns();
    let lengths: Vec<f64> = constraints.iter_rows().map(norm).collect();
    let used = constraints.iter_rows().zip(&lengths).filter(|(_, length)| **length > 0.0);
    let unit = used.map(|(row, length)| row.iter().map(|x| x / length).collect::<Vec<_>>());
    let unit = Matrix::from_rows(size, unit);
    if unit.rows() == 0 {
        return Some(Matrix::from_fn(size, size, |i, j| f64::from(u8::from(i == j))));
    }
    let eigen = symmetric_eigen(&transposed_multiply(&unit, &unit)).ok()?;
    let largest = eigen.values.last().copied()?;
    let bound = |values: &[f64]| values.iter().filter(|v| **v <= SMALL * largest).count();
    // The constraints are fewer than the sines that they leave free.
    let count = bound(&eigen.values).max(size.saturating_sub(unit.rows()));
    let kept: Vec<usize> = (0..count).collect();
    (count > 0).then(|| eigen.vectors.select_columns(&kept))
}
