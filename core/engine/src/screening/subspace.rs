//! Active subspace: the directions of the inputs in which the response changes, from its derivatives at the runs.
//!
//! The mean over the runs of the outer product of the gradient with itself has the eigenvalues `lambda_1 >= lambda_2 >=
//! ...`: the mean square slope of the response along each eigenvector. If a few of them carry nearly all of the sum, the
//! response depends on as many combinations of the inputs (Constantine, Dow and Wang, SIAM Journal on Scientific Computing
//! 36 (2014) A1500). Their spread is that of resampled runs (bootstrap; Constantine and Gleich, arXiv:1408.0545 (2015)).

use std::ops::Range;

use lacuna::math::moments::{quantile, sorted};
use lacuna::math::random::{Stream, below};
use lacuna_linalg::{Matrix, symmetric_eigen};
use serde::{Deserialize, Serialize};

/// Number of resampled sets of runs.
const RESAMPLED: u64 = 200;

/// Eigenvalues of the mean outer product of the gradients.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActiveSubspace {
    /// Eigenvalues, decreasing. The inputs are in standard deviations of their designs, and the responses are scaled to
    /// the sum of variances one.
    pub eigenvalues: Vec<f64>,
    /// Central 95 % of each eigenvalue over resampled runs.
    pub spread: Vec<(f64, f64)>,
    /// Mean square slope along each input, in the order of the inputs: the sum over the eigenvalues of each times the square
    /// of its eigenvector's component (activity score, Constantine and Diaz, Reliability Engineering and System Safety 162
    /// (2017) 1, with all directions).
    pub activity: Vec<f64>,
    /// Number of runs with derivatives.
    pub runs: usize,
}

impl ActiveSubspace {
    /// Smallest number of directions that carry this share of the mean square slope.
    pub fn directions(&self, share: f64) -> usize {
        let total: f64 = self.eigenvalues.iter().sum();
        let mut sum = 0.0;
        let short = |value: &&f64| {
            let before = sum;
            sum += **value;
            before < share * total
        };
        self.eigenvalues.iter().take_while(short).count()
    }
}

/// Finds the active subspace of responses (`runs x outputs`), the outputs of each block in the same unit.
///
/// `gradients` are the derivatives of the first output by all inputs, then of the second (`runs x (outputs * inputs)`), NaN
/// for a run without; `widths` are the standard deviations of the inputs. `None` if fewer than two runs have derivatives, or no
/// response varies.
pub fn active_subspace(
    gradients: &Matrix,
    widths: &[f64],
    responses: &Matrix,
    blocks: impl Iterator<Item = Range<usize>>,
    stream: &Stream,
) -> Option<ActiveSubspace> {
    let scales = super::scales(responses, blocks)?;
    let squares: Vec<Matrix> = gradients
        .iter_rows()
        .filter(|row| row.iter().all(|slope| slope.is_finite()))
        .map(|row| outer(row, widths, &scales))
        .collect();
    if squares.len() < 2 {
        return None;
    }
    let all: Vec<usize> = (0..squares.len()).collect();
    let mean = mean(&squares, &all);
    let eigenvalues = decreasing(&mean)?;
    let resampled: Vec<Vec<f64>> = (0..RESAMPLED)
        .map(|k| {
            let mut rng = stream.at(k).generator();
            let drawn: Vec<usize> = all.iter().map(|_| below(&mut rng, all.len())).collect();
            decreasing(&self::mean(&squares, &drawn))
        })
        .collect::<Option<_>>()?;
    let spread = |i: usize| {
        let values = sorted(&resampled.iter().map(|values| values[i]).collect::<Vec<f64>>());
        (quantile(&values, 0.025), quantile(&values, 0.975))
    };
    Some(ActiveSubspace {
        spread: (0..eigenvalues.len()).map(spread).collect(),
        activity: (0..widths.len()).map(|j| mean[(j, j)]).collect(),
        eigenvalues,
        runs: squares.len(),
    })
}

/// Sum over the outputs of the outer product of the scaled gradient with itself.
fn outer(row: &[f64], widths: &[f64], scales: &[f64]) -> Matrix {
    let d = widths.len();
    let mut sum = Matrix::zeros(d, d);
    for (slopes, scale) in row.chunks_exact(d).zip(scales) {
        let own: Vec<f64> = slopes.iter().zip(widths).map(|(g, w)| scale * g * w).collect();
        for (j, a) in own.iter().enumerate() {
            sum.row_mut(j).iter_mut().zip(&own).for_each(|(entry, b)| *entry += a * b);
        }
    }
    sum
}

fn mean(squares: &[Matrix], which: &[usize]) -> Matrix {
    let d = squares[0].rows();
    let mut mean = Matrix::zeros(d, d);
    for &i in which {
        let pairs = mean.as_mut_slice().iter_mut().zip(squares[i].as_slice());
        pairs.for_each(|(sum, entry)| *sum += entry / which.len() as f64);
    }
    mean
}

fn decreasing(matrix: &Matrix) -> Option<Vec<f64>> {
    let values = symmetric_eigen(matrix).ok()?.values;
    // Rounding errors make the smallest ones negative.
    Some(values.into_iter().rev().map(|value| value.max(0.0)).collect())
}
