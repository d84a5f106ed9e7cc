//! Many outputs of few runs in the axes of the runs.
//!
//! With the thin decomposition `Y - 1 m' = U S Q'` of `n` runs all that a linear method makes of the outputs is a
//! combination of the `n` columns of `Q`: the fit to the scores `U S`, a matrix as small as the number of runs squared, is
//! that to the outputs in other axes. `Q` itself is never needed, since `E Q' = E S^-1 U' (Y - 1 m')`.

use std::ops::Range;

use lacuna::run::Stop;
use lacuna_linalg::wide::{self, Axes};
use lacuna_linalg::{Matrix, multiply, multiply_transposed};
use rayon::prelude::*;

/// Responses in the axes of the runs.
pub struct Rotated {
    /// Scores `U S`, `runs x axes`.
    pub scores: Matrix,
    /// `U S^-1`, `runs x axes`.
    inverse: Matrix,
    /// Mean of each output.
    mean: Vec<f64>,
}

impl Rotated {
    /// Rotates responses, `runs x outputs`.
    pub fn of(responses: &Matrix) -> Result<Self, Stop> {
        let mean = wide::column_means(responses);
        let product = |blocks: &[Range<usize>]| wide::products(responses, &mean, blocks);
        let blocks = wide::blocks(mean.len());
        let parts: Vec<Matrix> = blocks.par_chunks(wide::TOGETHER).map(product).collect();
        let Axes { scores, inverse, .. } = Axes::of(&parts)
            .map_err(|e| Stop::new(format!("the products of the runs' responses: {e}")))?;
        Ok(Self { scores, inverse, mean })
    }

    /// Rotates differences in the axes of the runs (`any x axes`) back to the outputs of the same responses
    /// (`any x outputs`).
    pub fn to_outputs(&self, differences: &Matrix, responses: &Matrix) -> Matrix {
        let weights = multiply_transposed(differences, &self.inverse);
        let mut all = Matrix::zeros(weights.rows(), self.mean.len());
        for some in wide::blocks(self.mean.len()).chunks(wide::TOGETHER) {
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
