//! Directions of the common errors among the outputs that were measured.

use std::ops::Range;

use lacuna::plugin::discrepancy::CommonError;
use lacuna::run::Stop;
use lacuna_linalg::wide::{self, Axes};
use lacuna_linalg::{Error, Matrix, multiply, thin_svd, transposed_multiply};
use rayon::prelude::*;

/// Number of values of the factor above which it is decomposed a block of outputs at a time: 8 MB.
const LARGE: usize = 1 << 20;

/// Singular values of smaller factors relative to the largest below which directions are rounding errors.
const RESOLVED: f64 = 1e-12;

/// The thin singular value decomposition `W F = U diag(s) V'` of the factor of all common errors, `W` with the weight of
/// each measured output.
pub struct WeightedDirections {
    /// `U'`, `rank x measured`.
    pub rows: Matrix,
    /// Singular values, decreasing and above zero.
    pub values: Vec<f64>,
}

/// The factor of all common errors, weighted, at measured outputs.
pub struct WeightedFactor<'a> {
    /// Each column as the factor of its error and its place there.
    columns: Vec<(&'a Matrix, usize)>,
    measured: &'a [usize],
    weight: &'a [f64],
}

impl<'a> WeightedFactor<'a> {
    /// The factor at outputs with the indices `measured`; `weight` has the weight of each of them.
    pub fn of(common: &'a [CommonError], measured: &'a [usize], weight: &'a [f64]) -> Self {
        let of =
            |error: &'a CommonError| (0..error.factor.columns()).map(move |k| (&*error.factor, k));
        Self { columns: common.iter().flat_map(of).collect(), measured, weight }
    }

    /// The factor, `measured x columns`.
    pub fn whole(&self) -> Matrix {
        self.rows(0..self.measured.len())
    }

    fn rows(&self, outputs: Range<usize>) -> Matrix {
        Matrix::from_fn(outputs.len(), self.columns.len(), |i, k| {
            let (factor, column) = self.columns[k];
            let at = outputs.start + i;
            self.weight[at] * factor[(self.measured[at], column)]
        })
    }

    /// The directions of the errors.
    ///
    /// # Errors
    /// If the factor is not finite or has no decomposition.
    pub fn directions(&self) -> Result<WeightedDirections, Stop> {
        let (outputs, columns) = (self.measured.len(), self.columns.len());
        if columns == 0 {
            return Ok(WeightedDirections { rows: Matrix::zeros(0, outputs), values: Vec::new() });
        }
        let large = outputs * columns > LARGE && outputs > 8 * columns;
        let found = if large { self.by_blocks() } else { self.at_once() };
        found.map_err(|e| Stop::new(format!("the covariance of the common errors: {e}")))
    }

    fn at_once(&self) -> Result<WeightedDirections, Error> {
        let svd = thin_svd(&self.whole())?;
        let values: Vec<f64> =
            svd.values.iter().copied().filter(|&s| s > RESOLVED * svd.values[0]).collect();
        let rows = Matrix::from_fn(values.len(), svd.u.rows(), |k, i| svd.u[(i, k)]);
        Ok(WeightedDirections { rows, values })
    }

    /// The same from products of the columns, block by block, without a copy of the factor. The eigenvectors of `A'A` make
    /// the columns of `A` orthonormal up to the square of its condition; once more, up to rounding (the two steps of
    /// `CholeskyQR2`: Yamamoto, Nakatsukasa, Yanagisawa and Fukaya, Electronic Transactions on Numerical Analysis 44 (2015)
    /// 306). What remains is the decomposition of a matrix as small as the number of columns.
    fn by_blocks(&self) -> Result<WeightedDirections, Error> {
        let first = self.axes(None)?;
        if first.values.is_empty() {
            let rows = Matrix::zeros(0, self.measured.len());
            return Ok(WeightedDirections { rows, values: Vec::new() });
        }
        let second = self.axes(Some(&first.inverse))?;
        // A = Q S2 W' S1 V' with Q = A V S1^-1 W S2^-1.
        let small = transposed_multiply(&second.scores, &first.scores.transposed());
        let svd = thin_svd(&small)?;
        let weights = multiply(&multiply(&first.inverse, &second.inverse), &svd.u);
        let mut rows = Matrix::zeros(svd.values.len(), self.measured.len());
        for some in wide::blocks(self.measured.len()).chunks(wide::TOGETHER) {
            let block = |own: &Range<usize>| multiply(&self.rows(own.clone()), &weights);
            let blocks: Vec<Matrix> = some.par_iter().map(block).collect();
            for (block, own) in blocks.iter().zip(some) {
                for k in 0..block.columns() {
                    let column = block.iter_rows().map(|row| row[k]);
                    rows.row_mut(k)[own.clone()].iter_mut().zip(column).for_each(|(u, x)| *u = x);
                }
            }
        }
        Ok(WeightedDirections { rows, values: svd.values })
    }

    /// Axes of the columns of the factor, or of its product with `turned`.
    fn axes(&self, turned: Option<&Matrix>) -> Result<Axes, Error> {
        let products = |blocks: &[Range<usize>]| {
            let size = turned.map_or(self.columns.len(), Matrix::columns);
            let mut sum = Matrix::zeros(size, size);
            for outputs in blocks {
                let rows = self.rows(outputs.clone());
                let rows = match turned {
                    Some(by) => multiply(&rows, by),
                    None => rows,
                };
                let own = transposed_multiply(&rows, &rows);
                sum.as_mut_slice().iter_mut().zip(own.as_slice()).for_each(|(s, x)| *s += x);
            }
            sum
        };
        let blocks = wide::blocks(self.measured.len());
        let parts: Vec<Matrix> = blocks.par_chunks(wide::TOGETHER).map(products).collect();
        Axes::of(&parts)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lacuna::math::random::{Stream, normal};
    use lacuna::plugin::discrepancy::ErrorOrigin;

    use super::*;

    /// Errors of sizes from one to a hundred thousandth, of which one is a combination of two others.
    fn errors(outputs: usize) -> Vec<CommonError> {
        let mut rng = Stream::root(4).generator();
        let mut factor = Matrix::from_fn(outputs, 6, |i, k| {
            10f64.powi(-(k as i32))
                * ((0.001 * (k + 1) as f64 * i as f64).sin() + 0.1 * normal(&mut rng))
        });
        for i in 0..outputs {
            factor[(i, 5)] = factor[(i, 0)] + factor[(i, 1)];
        }
        let smallest = Matrix::from_fn(outputs, 1, |_, _| 1e-5 * normal(&mut rng));
        [(ErrorOrigin::Emulator, factor), (ErrorOrigin::Replicates, smallest)]
            .map(|(origin, factor)| CommonError { origin, factor: factor.into(), predictive: true })
            .to_vec()
    }

    /// The decomposition of the whole factor by LAPACK's method, as `faer` has it, is the reference: values agree to the
    /// rounding of the products relative to the largest, and directions are orthonormal and span the same space.
    #[test]
    fn blocks_give_the_decomposition_of_the_whole() {
        let outputs = 40_000;
        let common = errors(outputs);
        let measured: Vec<usize> = (0..outputs).filter(|i| i % 7 != 3).collect();
        let weight: Vec<f64> = measured.iter().map(|i| 1.0 + (i % 3) as f64).collect();
        let factor = WeightedFactor::of(&common, &measured, &weight);
        let (whole, blocks) = (factor.at_once().unwrap(), factor.by_blocks().unwrap());
        assert_eq!(blocks.values.len(), 6);
        for (a, b) in whole.values.iter().zip(&blocks.values) {
            assert!((a / b - 1.0).abs() < 1e-10, "{a} {b}");
        }
        for k in 0..6 {
            for l in 0..6 {
                let inner = |a: &Matrix, b: &Matrix| lacuna_linalg::vector::dot(a.row(k), b.row(l));
                let unit = f64::from(u8::from(k == l));
                assert!((inner(&blocks.rows, &blocks.rows) - unit).abs() < 1e-10);
                assert!((inner(&whole.rows, &blocks.rows).abs() - unit).abs() < 1e-8, "{k} {l}");
            }
        }
    }

    #[test]
    fn errors_that_vanish_have_no_directions() {
        let factor = Matrix::zeros(300_000, 4);
        let common = [CommonError {
            origin: ErrorOrigin::Emulator,
            factor: factor.into(),
            predictive: true,
        }];
        let measured: Vec<usize> = (0..300_000).collect();
        let weight = vec![1.0; 300_000];
        let found = WeightedFactor::of(&common, &measured, &weight).directions().unwrap();
        assert_eq!((found.rows.rows(), found.rows.columns()), (0, 300_000));
        assert!(found.values.is_empty());
    }
}
