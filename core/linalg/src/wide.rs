//! Matrices of many columns, some columns at a time: what is derived from them needs little memory of its own.

use std::ops::Range;

use crate::{Error, Matrix, multiply_transposed, symmetric_eigen};

/// Number of columns that are derived at a time.
const BLOCK: usize = 8192;

/// Number of blocks that are best derived together, on all processors.
pub const TOGETHER: usize = 16;

/// Singular values relative to the largest that the products of the rows resolve: the square root of the rounding error,
/// and a margin.
const RESOLVED: f64 = 1e-7;

/// Axes of the rows: with the thin decomposition `A = U S Q'` the rows are `U S` in the axes `Q`, and `Q = A' U S^-1`.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes {
    /// Singular values, decreasing; those that the products do not resolve are left out.
    pub values: Vec<f64>,
    /// `U S`, `m x axes`.
    pub scores: Matrix,
    /// `U S^-1`, `m x axes`.
    pub inverse: Matrix,
}

impl Axes {
    /// The axes from parts of the products `A A'`, which are added in their order.
    ///
    /// # Errors
    /// If the products have no eigendecomposition.
    pub fn of(parts: &[Matrix]) -> Result<Self, Error> {
        let rows = parts.first().map_or(0, Matrix::rows);
        let mut products = Matrix::zeros(rows, rows);
        for part in parts {
            products.as_mut_slice().iter_mut().zip(part.as_slice()).for_each(|(s, x)| *s += x);
        }
        let eigen = symmetric_eigen(&products)?;
        // The eigenvalues are in increasing order.
        let mut values: Vec<f64> = eigen.values.iter().rev().map(|v| v.max(0.0).sqrt()).collect();
        let largest = values.first().copied().unwrap_or(0.0);
        values.retain(|s| *s > RESOLVED * largest);
        let size = values.len();
        let scores =
            Matrix::from_fn(rows, size, |i, k| eigen.vectors[(i, rows - 1 - k)] * values[k]);
        let inverse = Matrix::from_fn(rows, size, |i, k| scores[(i, k)] / (values[k] * values[k]));
        Ok(Self { values, scores, inverse })
    }
}

/// Ranges of consecutive columns, whose boundaries depend on the number of columns alone.
pub fn blocks(columns: usize) -> Vec<Range<usize>> {
    (0..columns).step_by(BLOCK).map(|first| first..columns.min(first + BLOCK)).collect()
}

/// Mean of each column of a matrix with rows.
pub fn column_means(a: &Matrix) -> Vec<f64> {
    let mut sums = vec![0.0; a.columns()];
    for row in a.iter_rows() {
        sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
    }
    sums.into_iter().map(|sum| sum / a.rows() as f64).collect()
}

/// Some columns, less their means.
pub fn centred(a: &Matrix, means: &[f64], columns: &Range<usize>) -> Matrix {
    let mut block = Matrix::zeros(a.rows(), columns.len());
    for (i, row) in a.iter_rows().enumerate() {
        let values = row[columns.clone()].iter().zip(&means[columns.clone()]);
        block.row_mut(i).iter_mut().zip(values).for_each(|(entry, (x, mean))| *entry = x - mean);
    }
    block
}

/// `C C'` for the columns of some blocks, less their means: `m x m` for an `m x n` matrix.
pub fn products(a: &Matrix, means: &[f64], blocks: &[Range<usize>]) -> Matrix {
    let mut sum = Matrix::zeros(a.rows(), a.rows());
    for columns in blocks {
        let block = centred(a, means, columns);
        let product = multiply_transposed(&block, &block);
        sum.as_mut_slice().iter_mut().zip(product.as_slice()).for_each(|(s, x)| *s += x);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole numbers have products without rounding errors.
    #[test]
    fn products_of_blocks_add_up_to_the_product() {
        let a = Matrix::from_fn(3, 20_000, |i, j| ((i + 2) * j % 17) as f64);
        let zero = vec![0.0; 20_000];
        let all = blocks(20_000);
        assert_eq!(all.len(), 3);
        assert_eq!(products(&a, &zero, &all), multiply_transposed(&a, &a));
        let block = centred(&a, &column_means(&a), &all[2]);
        assert_eq!((block.rows(), block.columns()), (3, 20_000 - 2 * BLOCK));
        let sum: f64 = (0..3).map(|i| block[(i, 5)]).sum();
        assert!(sum.abs() < 1e-12);
    }
}
