//! Common errors given the data.
//!
//! A common error is `F w` with independent standard normal weights `w`; the log-likelihood `l` of the response `r`, in which
//! it is integrated out, has gradient and Hessian
//!
//! ```text
//! E[w | data] = F' l'(r),   Cov[w | data] = I + F' l''(r) F
//! ```
//!
//! (the identity of Tweedie: Robbins, Proc. 3rd Berkeley Symp. (1956) 157; Efron, J. Am. Stat. Assoc. 106 (2011) 1602, here
//! for a vector). It holds for every likelihood that contains the error; the weights are drawn as normal numbers with these
//! moments, which is exact for normal discrepancies. The mean is that of each draw of the posterior; the covariance, which
//! depends on the draw by the variance of the noise alone, is that at the MAP.
//!
//! The likelihoods of several blocks of scenarios contain the errors as if they were independent between blocks. Each then
//! knows the weights with moments `m_b`, `S_b` of its own, and together they know them with the covariance
//! `S = (I + sum_b (S_b^-1 - I))^-1` and the mean `S sum_b S_b^-1 m_b`.

use std::ops::Range;

use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Likelihood;
use lacuna_linalg::{
    Matrix, multiply, multiply_transposed, multiply_vector, symmetric_eigen, transposed_multiply,
};

/// Weights of common errors given the data; see the module.
pub(super) struct GivenData {
    /// Factor of all errors, `outputs x weights`.
    factor: Matrix,
    blocks: Vec<Block>,
    /// Root `L` of the covariance `L L'` of the weights.
    root: Matrix,
}

/// Contribution of a block of scenarios to the mean of the weights.
struct Block {
    outputs: Range<usize>,
    /// `S S_b^-1`; `None` for the identity.
    share: Option<Matrix>,
}

/// Step of the differences that give the Hessian, in standard deviations of an error.
const STEP: f64 = 1e-3;

/// Least variance of a weight given the data: below it the differences are rounding errors.
const LEAST: f64 = 1e-9;

impl GivenData {
    /// Weights of the errors with this factor (`outputs x weights`) under a likelihood that contains them, with the
    /// covariance at this response and these hyperparameters; `None` if the likelihood has no finite derivatives there.
    pub fn new(
        factor: Matrix,
        blocks: impl Iterator<Item = Range<usize>>,
        likelihood: &dyn Likelihood,
        (response, hyper): (&[f64], &[f64]),
    ) -> Option<Self> {
        let change = change_of_gradient(&factor, likelihood, response, hyper);
        let mut outputs: Vec<Range<usize>> = blocks.collect();
        let covariance = |range: &Range<usize>| covariance(&factor, &change, range.clone());
        if outputs.len() == 1 {
            let root = powers(&covariance(&outputs[0]), 0.5)?;
            let blocks = vec![Block { outputs: outputs.remove(0), share: None }];
            return Some(Self { factor, blocks, root });
        }
        let weights = factor.columns();
        let known = |range: &Range<usize>| powers(&covariance(range), -1.0);
        let precisions: Vec<Matrix> = outputs.iter().map(known).collect::<Option<_>>()?;
        let total = Matrix::from_fn(weights, weights, |i, j| {
            let own = f64::from(u8::from(i == j));
            own + precisions.iter().map(|p| p[(i, j)] - own).sum::<f64>()
        });
        let together = powers(&total, -1.0)?;
        let blocks = outputs.into_iter().zip(&precisions);
        let blocks = blocks
            .map(|(outputs, own)| Block { outputs, share: Some(multiply(&together, own)) })
            .collect();
        Some(Self { root: powers(&together, 0.5)?, factor, blocks })
    }

    /// One draw of the weights, given the derivative of the log-likelihood by the response.
    pub fn draw(&self, gradient: &[f64], stream: &Stream) -> Vec<f64> {
        let mut rng = stream.generator();
        let noise: Vec<f64> = (0..self.factor.columns()).map(|_| normal(&mut rng)).collect();
        let Some(mean) = self.mean(gradient) else { return noise };
        let mut weights = multiply_vector(&self.root, &noise);
        weights.iter_mut().zip(mean).for_each(|(w, m)| *w += m);
        weights
    }

    /// Mean of the weights, given the derivative of the log-likelihood by the response; `None` if it is not finite.
    pub fn mean(&self, gradient: &[f64]) -> Option<Vec<f64>> {
        if gradient.iter().any(|slope| !slope.is_finite()) {
            return None;
        }
        let mut weights = vec![0.0; self.factor.columns()];
        for block in &self.blocks {
            let mut mean = vec![0.0; weights.len()];
            for i in block.outputs.clone().filter(|&i| gradient[i] != 0.0) {
                let row = self.factor.row(i);
                mean.iter_mut().zip(row).for_each(|(m, f)| *m += f * gradient[i]);
            }
            if let Some(share) = &block.share {
                mean = multiply_vector(share, &mean);
            }
            weights.iter_mut().zip(mean).for_each(|(w, m)| *w += m);
        }
        Some(weights)
    }

    /// Factor of the errors of some weights about their mean, `outputs x variables`, with independent standard normal
    /// variables.
    pub fn spread(&self, columns: Range<usize>) -> Matrix {
        let columns: Vec<usize> = columns.collect();
        multiply(&self.factor.select_columns(&columns), &self.root.select_rows(&columns))
    }

    /// Values of the errors of some weights: `columns` of the factor.
    pub fn values(&self, weights: &[f64], columns: Range<usize>) -> Vec<f64> {
        let product = |row: &[f64]| {
            row[columns.clone()].iter().zip(&weights[columns.clone()]).map(|(f, w)| f * w).sum()
        };
        self.factor.iter_rows().map(product).collect()
    }
}

/// `l''(r) F` by central differences of the gradient, `outputs x weights`.
fn change_of_gradient(
    factor: &Matrix,
    likelihood: &dyn Likelihood,
    response: &[f64],
    hyper: &[f64],
) -> Matrix {
    let columns: Vec<Vec<f64>> = (0..factor.columns())
        .map(|k| {
            let beside = |step: f64| {
                let moved = response.iter().zip(factor.iter_rows());
                let moved: Vec<f64> = moved.map(|(r, row)| r + step * row[k]).collect();
                likelihood.gradient(&moved, hyper).0
            };
            let (after, before) = (beside(STEP), beside(-STEP));
            after.iter().zip(before).map(|(a, b)| (a - b) / (2.0 * STEP)).collect()
        })
        .collect();
    Matrix::from_fn(factor.rows(), columns.len(), |i, k| columns[k][i])
}

/// `I + F' l'' F` over the outputs of a block.
fn covariance(factor: &Matrix, change: &Matrix, outputs: Range<usize>) -> Matrix {
    let outputs: Vec<usize> = outputs.collect();
    let product = transposed_multiply(&factor.select_rows(&outputs), &change.select_rows(&outputs));
    Matrix::from_fn(product.rows(), product.columns(), |i, j| {
        f64::from(u8::from(i == j)) + 0.5 * (product[(i, j)] + product[(j, i)])
    })
}

/// A power of a symmetric matrix whose eigenvalues are at least [`LEAST`] or are raised to it.
fn powers(matrix: &Matrix, power: f64) -> Option<Matrix> {
    if matrix.as_slice().iter().any(|value| !value.is_finite()) {
        return None;
    }
    if matrix.rows() == 0 {
        return Some(matrix.clone());
    }
    let eigen = symmetric_eigen(matrix).ok()?;
    let scaled = Matrix::from_fn(matrix.rows(), matrix.columns(), |i, k| {
        eigen.vectors[(i, k)] * eigen.values[k].max(LEAST).powf(power)
    });
    Some(multiply_transposed(&scaled, &eigen.vectors))
}

#[cfg(test)]
mod tests;
