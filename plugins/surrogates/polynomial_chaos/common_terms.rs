//! Least squares of all outputs on common terms, for many more runs than terms.
//!
//! The normal equations are summed over blocks of runs, so that memory holds the basis functions of few runs at a time.
//! With ten runs of the design per term the Gram matrix of orthonormal polynomials is close to a multiple of the
//! identity (Cohen, Davenport and Leviatan, Foundations of Computational Mathematics 13 (2013) 819), so that no digits
//! are lost; where it is not, [`fit`] returns `None`.

use lacuna_linalg::{Cholesky, Matrix, multiply, multiply_transposed};
use rayon::prelude::*;

use super::judge::correction;
use super::terms::Basis;

/// Number of runs per term of all outputs from which on all outputs are fitted with all of these terms: the variance
/// of the coefficients adds at most a tenth to the mean square error.
const RUNS_PER_TERM: usize = 10;
/// Number of runs whose basis functions are in memory at a time.
const BLOCK: usize = 1024;
/// Number of terms or outputs whose products are summed together.
const TILE: usize = 128;
/// Least ratio of the smallest to the largest pivot of the Gram matrix.
const LEAST_PIVOT: f64 = 1e-8;

/// Regression of all outputs.
pub(super) struct CommonFit {
    /// Coefficients (`terms x outputs`).
    pub coefficients: Matrix,
    /// Corrected leave-one-out error relative to each output's variance.
    pub relative: Vec<f64>,
    /// Leave-one-out residuals (`runs x outputs`).
    pub residuals: Matrix,
}

/// Returns true if so many runs determine all terms well.
pub(super) fn is_enough(runs: usize, terms: usize) -> bool {
    runs >= RUNS_PER_TERM * terms
}

/// Returns how often [`fit`] reports progress.
pub(super) fn ticks(runs: usize) -> u64 {
    2 * runs.div_ceil(BLOCK) as u64
}

/// Fits responses (`runs x outputs`) with given means and variances; the first basis function is the constant. `tick` is
/// called after each block of runs. `None` if the basis functions are nearly dependent on these runs.
pub(super) fn fit(
    basis: &Basis,
    points: &Matrix,
    responses: &Matrix,
    (means, variances): (&[f64], &[f64]),
    tick: &(impl Fn() + Sync),
) -> Option<CommonFit> {
    let (runs, outputs, terms) = (points.rows(), responses.columns(), basis.terms().len());
    let [gram, products] = sums(basis, points, responses, means, tick);
    let factor = Cholesky::new(&gram).ok()?;
    let pivots = || (0..terms).map(|t| factor.lower()[(t, t)]);
    let largest = pivots().fold(0.0, f64::max);
    if pivots().any(|p| p * p <= LEAST_PIVOT * largest * largest) {
        return None;
    }
    let inverse = factor.lower_inverse();
    let trace = inverse.as_slice().iter().map(|x| x * x).sum();
    let mut coefficients = factor.solve_matrix(&products);
    let mut residuals = Matrix::zeros(runs, outputs);
    let blocks = residuals.as_mut_slice().par_chunks_mut((BLOCK * outputs).max(1)).enumerate();
    blocks.for_each(|(b, block)| {
        let rows: Vec<usize> = (b * BLOCK..runs.min((b + 1) * BLOCK)).collect();
        let psi = basis.values(&points.select_rows(&rows));
        let model = multiply(&psi, &coefficients);
        let whitened = multiply_transposed(&psi, &inverse);
        for (i, residual) in block.chunks_exact_mut(outputs).enumerate() {
            let leverage: f64 = whitened.row(i).iter().map(|x| x * x).sum();
            let measured = responses.row(rows[i]);
            for o in 0..outputs {
                residual[o] = (measured[o] - means[o] - model[(i, o)]) / (1.0 - leverage);
            }
        }
        tick();
    });
    coefficients.row_mut(0).iter_mut().zip(means).for_each(|(c, mean)| *c += mean);
    let mut squares = vec![0.0; outputs];
    for row in residuals.iter_rows() {
        squares.iter_mut().zip(row).for_each(|(sum, r)| *sum += r * r);
    }
    let correction = correction(runs, terms, trace);
    let relative = |(sum, &v): (&f64, &f64)| match sum / runs as f64 / v * correction {
        _ if v == 0.0 => 0.0,
        // A run that alone determines a term cannot be left out.
        error if error.is_nan() => f64::INFINITY,
        error => error,
    };
    let relative = squares.iter().zip(variances).map(relative).collect();
    Some(CommonFit { coefficients, relative, residuals })
}

/// Returns the Gram matrix of the basis functions (`terms x terms`), of which only the lower triangle is set, and their
/// products with the responses less their means (`terms x outputs`).
fn sums(
    basis: &Basis,
    points: &Matrix,
    responses: &Matrix,
    means: &[f64],
    tick: &impl Fn(),
) -> [Matrix; 2] {
    let (runs, terms, outputs) = (points.rows(), basis.terms().len(), responses.columns());
    let (left, right) = (terms.div_ceil(TILE), outputs.div_ceil(TILE));
    let own = (0..left).flat_map(|i| (0..=i).map(move |j| (i, j)));
    let with = (0..left).flat_map(|i| (0..right).map(move |o| (i, left + o)));
    let size = |tile: usize| match tile.checked_sub(left) {
        Some(o) => TILE.min(outputs - o * TILE),
        None => TILE.min(terms - tile * TILE),
    };
    let mut tiles: Vec<((usize, usize), Matrix)> =
        own.chain(with).map(|(i, j)| ((i, j), Matrix::zeros(size(i), size(j)))).collect();
    for first in (0..runs).step_by(BLOCK) {
        let rows: Vec<usize> = (first..runs.min(first + BLOCK)).collect();
        let psi = basis.values(&points.select_rows(&rows));
        let columns: Vec<Matrix> = (0..left + right)
            .into_par_iter()
            .map(|tile| match tile.checked_sub(left) {
                Some(o) => Matrix::from_fn(size(tile), rows.len(), |k, i| {
                    responses[(rows[i], o * TILE + k)] - means[o * TILE + k]
                }),
                None => Matrix::from_fn(size(tile), rows.len(), |k, i| psi[(i, tile * TILE + k)]),
            })
            .collect();
        tiles.par_iter_mut().for_each(|((i, j), sum)| {
            let product = multiply_transposed(&columns[*i], &columns[*j]);
            sum.as_mut_slice().iter_mut().zip(product.as_slice()).for_each(|(s, p)| *s += p);
        });
        tick();
    }
    let (mut gram, mut products) = (Matrix::zeros(terms, terms), Matrix::zeros(terms, outputs));
    for ((i, j), sum) in &tiles {
        let (whole, column) = match j.checked_sub(left) {
            Some(o) => (&mut products, o * TILE),
            None => (&mut gram, j * TILE),
        };
        for (r, row) in sum.iter_rows().enumerate() {
            whole.row_mut(i * TILE + r)[column..column + row.len()].copy_from_slice(row);
        }
    }
    [gram, products]
}
