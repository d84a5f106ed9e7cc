//! Sums of the products `T_g' T_g` of groups, and their traces with an inverse.
//!
//! Stored products cost reading `rank^2 / 2` numbers per group, whatever its size; for groups of few rows it is
//! faster to compute the products than to read them.

use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Cholesky, Matrix};

/// The products, stored or computed on demand (see the module).
#[derive(Debug, Clone)]
pub(super) enum Grams {
    /// Lower triangle of each product, row by row.
    Kept(Vec<Vec<f64>>),
    /// All factors side by side, transposed (`rank x rows`).
    Made(Matrix),
}

/// Mean number of rows up to which products are computed on demand.
const FEW: usize = 30;

impl Grams {
    /// Prepares the products of the factors `T_g`.
    pub fn of(factors: &[Matrix]) -> Self {
        let rows: usize = factors.iter().map(Matrix::rows).sum();
        if rows > FEW * factors.len() {
            return Self::Kept(factors.iter().map(|t| lower(&lacuna_linalg::gram(t))).collect());
        }
        let rank = factors.first().map_or(0, Matrix::columns);
        let stacked = Matrix::from_rows(rank, factors.iter().flat_map(Matrix::iter_rows));
        Self::Made(stacked.transposed())
    }

    /// Returns the lower triangle of `sum_g T_g' T_g / v_g`.
    pub fn sum(&self, factors: &[Matrix], variance: &[f64]) -> Matrix {
        let rank = factors.first().map_or(0, Matrix::columns);
        match self {
            Self::Kept(grams) => {
                let mut sum = vec![0.0; rank * (rank + 1) / 2];
                for (gram, v) in grams.iter().zip(variance) {
                    add_scaled(&mut sum, 1.0 / v, gram);
                }
                let mut square = Matrix::zeros(rank, rank);
                for i in 0..rank {
                    square.row_mut(i)[..=i].copy_from_slice(&sum[start(i)..start(i + 1)]);
                }
                square
            }
            Self::Made(turned) => {
                let mut weighted = Matrix::zeros(turned.columns(), rank);
                let mut row = 0;
                for (factor, v) in factors.iter().zip(variance) {
                    for from in factor.iter_rows() {
                        add_scaled(weighted.row_mut(row), 1.0 / v.sqrt(), from);
                        row += 1;
                    }
                }
                lacuna_linalg::gram(&weighted)
            }
        }
    }

    /// Returns `tr(C^-1 T_g' T_g)` for each group.
    pub fn traces(&self, factors: &[Matrix], capacitance: &Cholesky) -> Vec<f64> {
        match self {
            Self::Kept(grams) => {
                let inverse = capacitance.inverse();
                let (packed, n) = (lower(&inverse), inverse.rows());
                let trace = |gram: &Vec<f64>| {
                    let diagonal: f64 = (0..n).map(|i| inverse[(i, i)] * gram[start(i) + i]).sum();
                    2.0 * dot(&packed, gram) - diagonal
                };
                grams.iter().map(trace).collect()
            }
            Self::Made(turned) => {
                let white = capacitance.whiten_matrix(turned);
                let mut squares = vec![0.0; white.columns()];
                for row in white.iter_rows() {
                    squares.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * x);
                }
                let mut rest = &squares[..];
                let own = |factor: &Matrix| {
                    let (own, after) = rest.split_at(factor.rows());
                    rest = after;
                    own.iter().sum()
                };
                factors.iter().map(own).collect()
            }
        }
    }
}

/// Returns the start of a row in a packed lower triangle.
fn start(row: usize) -> usize {
    row * (row + 1) / 2
}

/// Packs the lower triangle of a symmetric matrix.
fn lower(matrix: &Matrix) -> Vec<f64> {
    let rows = matrix.iter_rows().enumerate();
    rows.flat_map(|(i, row)| row[..=i].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::discrepancies::common::testing::{close, random_matrix};

    /// Compares with the explicit products, for groups of many rows (stored) and of few (computed).
    #[test]
    fn sums_and_traces_are_those_of_the_products_written_out() {
        let rank = 45;
        for (rows, kept) in [([40, 45, 33], true), ([12, 0, 45], false)] {
            let factors: Vec<Matrix> =
                (0..3).map(|g| random_matrix(rows[g], rank, g as u64)).collect();
            let grams = Grams::of(&factors);
            assert_eq!(matches!(grams, Grams::Kept(_)), kept);
            let variance = [0.3, 2.0, 0.7];
            let products: Vec<Matrix> = factors.iter().map(lacuna_linalg::gram).collect();
            let mut written = Matrix::from_fn(rank, rank, |i, j| {
                products.iter().zip(variance).map(|(m, v)| m[(i, j)] / v).sum()
            });
            let mut found = grams.sum(&factors, &variance);
            for i in 0..rank {
                (0..=i).for_each(|j| close(found[(i, j)], written[(i, j)], 1e-10));
                written[(i, i)] += 1.0;
                found[(i, i)] += 1.0;
            }
            let inverse = Cholesky::new(&written).unwrap().inverse();
            let traces = grams.traces(&factors, &Cholesky::new(&found).unwrap());
            for (trace, product) in traces.iter().zip(&products) {
                close(*trace, dot(inverse.as_slice(), product.as_slice()), 1e-10);
            }
        }
    }
}
