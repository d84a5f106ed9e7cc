//! Many outputs of few runs in the axes of the runs.
//!
//! With the thin decomposition `Y - 1 m' = U S Q'` of `n` runs all that a linear method makes of the outputs is a
//! combination of the `n` columns of `Q`: the fit to the scores `U S`, a matrix as small as the number of runs squared, is
//! that to the outputs in other axes. `Q` itself is never needed, since `E Q' = E S^-1 U' (Y - 1 m')`.

use std::ops::Range;

use lacuna::run::Stop;
use lacuna_linalg::{Matrix, multiply, symmetric_eigen, wide};
use rayon::prelude::*;

/// Number of blocks of outputs computed together.
const TOGETHER: usize = 16;

/// Singular values relative to the largest that the products of the runs resolve: the square root of the rounding error,
/// and a margin.
const RESOLVED: f64 = 1e-7;

/// Responses in the axes of the runs.
pub struct Rotated {
    /// Scores `U S`, `runs x axes`.
    pub scores: Matrix,
    /// `S^-1 U'`, `axes x runs`.
    back: Matrix,
    /// Mean of each output.
    mean: Vec<f64>,
}

impl Rotated {
    /// Rotates responses, `runs x outputs`.
    pub fn of(responses: &Matrix) -> Result<Self, Stop> {
        let (runs, mean) = (responses.rows(), wide::column_means(responses));
        let product = |blocks: &[Range<usize>]| wide::products(responses, &mean, blocks);
        let blocks = wide::blocks(mean.len());
        let parts: Vec<Matrix> = blocks.par_chunks(TOGETHER).map(product).collect();
        let mut products = Matrix::zeros(runs, runs);
        for part in &parts {
            products.as_mut_slice().iter_mut().zip(part.as_slice()).for_each(|(s, x)| *s += x);
        }
        let eigen = symmetric_eigen(&products)
            .map_err(|e| Stop::new(format!("the products of the runs' responses: {e}")))?;
        let values: Vec<f64> = eigen.values.iter().map(|v| v.max(0.0).sqrt()).collect();
        let largest = values.last().copied().unwrap_or(0.0);
        let axes: Vec<usize> =
            (0..runs).rev().filter(|&k| values[k] > RESOLVED * largest).collect();
        let scores =
            Matrix::from_fn(runs, axes.len(), |i, k| eigen.vectors[(i, axes[k])] * values[axes[k]]);
        let back =
            Matrix::from_fn(axes.len(), runs, |k, i| eigen.vectors[(i, axes[k])] / values[axes[k]]);
        Ok(Self { scores, back, mean })
    }

    /// Rotates differences in the axes of the runs (`any x axes`) back to the outputs of the same responses
    /// (`any x outputs`).
    pub fn to_outputs(&self, differences: &Matrix, responses: &Matrix) -> Matrix {
        let weights = multiply(differences, &self.back);
        let mut all = Matrix::zeros(weights.rows(), self.mean.len());
        for some in wide::blocks(self.mean.len()).chunks(TOGETHER) {
            let block =
                |own: &Range<usize>| multiply(&weights, &wide::centred(responses, &self.mean, own));
            let blocks: Vec<Matrix> = some.par_iter().map(block).collect();
            for (block, own) in blocks.iter().zip(some) {
                for (i, row) in block.iter_rows().enumerate() {
                    all.row_mut(i)[own.clone()].copy_from_slice(row);
                }
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna::math::random::{Stream, normal};

    /// The scores keep all distances between runs, and a rotation back gives the responses less their mean, because the
    /// axes are orthonormal and span them.
    #[test]
    fn distances_are_kept_and_the_way_back_is_the_inverse() {
        let mut rng = Stream::root(3).generator();
        let responses = Matrix::from_fn(12, 20_000, |i, j| {
            300.0 + (0.001 * (i * j) as f64).sin() + 0.01 * normal(&mut rng)
        });
        let rotated = Rotated::of(&responses).unwrap();
        let square =
            |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum() };
        for (i, j) in [(0, 1), (3, 11), (7, 2)] {
            let (plain, scores) = (
                square(responses.row(i), responses.row(j)),
                square(rotated.scores.row(i), rotated.scores.row(j)),
            );
            assert!((plain - scores).abs() < 1e-9 * plain, "{plain} {scores}");
        }
        let back = rotated.to_outputs(&rotated.scores, &responses);
        for j in [0, 8191, 8192, 19_999] {
            let mean = responses.column(j).iter().sum::<f64>() / 12.0;
            for i in 0..12 {
                assert!((back[(i, j)] + mean - responses[(i, j)]).abs() < 1e-8);
            }
        }
    }
}
