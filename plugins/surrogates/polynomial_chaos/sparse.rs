//! Sparse form of the coefficients: outputs choose their terms, so that each has few terms of the union.

use lacuna_linalg::Matrix;
use lacuna_linalg::lanes::{LANES, Lanes, sparse_multiply};

use super::terms::Basis;

/// Ratio of all to non-zero coefficients above which a sparse product is faster than a dense one (measured: 3.5).
const SHARE: usize = 4;

/// Non-zero coefficients, output by output.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sparse {
    /// Start of each output's coefficients, and the end of the last.
    starts: Vec<usize>,
    terms: Vec<u16>,
    weights: Vec<f64>,
}

impl Sparse {
    /// Converts coefficients (`terms x outputs`); `None` if a dense product is faster, or there are too many terms
    /// for the indices.
    pub fn of(coefficients: &Matrix) -> Option<Self> {
        let all = coefficients.as_slice();
        let used = all.iter().filter(|c| **c != 0.0).count();
        if SHARE * used > all.len() || coefficients.rows() > usize::from(u16::MAX) {
            return None;
        }
        let (mut terms, mut weights) = (Vec::with_capacity(used), Vec::with_capacity(used));
        let mut starts = vec![0];
        for output in coefficients.transposed().iter_rows() {
            for (t, &c) in output.iter().enumerate().filter(|(_, c)| **c != 0.0) {
                terms.push(t as u16);
                weights.push(c);
            }
            starts.push(terms.len());
        }
        Some(Self { starts, terms, weights })
    }

    fn outputs(&self) -> usize {
        self.starts.len() - 1
    }

    fn sum(&self, table: &[Lanes], sums: &mut [Lanes]) {
        sparse_multiply(&self.starts, &self.terms, &self.weights, table, sums);
    }

    /// Returns the outputs at each point (`points x outputs`). Each point has its own lane, so that its bits do not
    /// depend on the others.
    pub fn mean(&self, basis: &Basis, points: &Matrix) -> Matrix {
        let mut mean = Matrix::zeros(points.rows(), self.outputs());
        let mut table = vec![[0.0; LANES]; basis.terms().len()];
        let mut sums = vec![[0.0; LANES]; self.outputs()];
        basis.in_lanes(points, |range, products| {
            for (value, &place) in table.iter_mut().zip(basis.places()) {
                *value = products[place as usize];
            }
            self.sum(&table, &mut sums);
            for (l, r) in range.enumerate() {
                for (y, sum) in mean.row_mut(r).iter_mut().zip(&sums) {
                    *y = sum[l];
                }
            }
        });
        mean
    }

    /// Returns the transposed coefficients times a matrix with one row per term.
    pub fn transposed_multiply(&self, matrix: &Matrix) -> Matrix {
        let mut product = Matrix::zeros(self.outputs(), matrix.columns());
        let mut table = vec![[0.0; LANES]; matrix.rows()];
        let mut sums = vec![[0.0; LANES]; self.outputs()];
        for first in (0..matrix.columns()).step_by(LANES) {
            let range = first..matrix.columns().min(first + LANES);
            for (entry, row) in table.iter_mut().zip(matrix.iter_rows()) {
                entry[..range.len()].copy_from_slice(&row[range.clone()]);
            }
            self.sum(&table, &mut sums);
            for (o, sum) in sums.iter().enumerate() {
                product.row_mut(o)[range.clone()].copy_from_slice(&sum[..range.len()]);
            }
        }
        product
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use lacuna::math::random::{Stream, normal, uniform};
    use lacuna_linalg::{multiply, transposed_multiply};

    use super::super::coordinate::Coordinate;
    use super::super::terms::{Nested, Truncation};
    use super::*;

    /// A basis, and coefficients of which a tenth are non-zero.
    fn problem() -> (Basis, Matrix) {
        let truncation = Truncation { q_norm: 1.0, max_interaction: 3 };
        let terms = Nested::new(3, 9, truncation, 1000).terms;
        let mut rng = Stream::root(5).generator();
        let mut entry = || if uniform(&mut rng) < 0.1 { normal(&mut rng) } else { 0.0 };
        let coefficients = Matrix::from_fn(terms.len(), 40, |_, _| entry());
        (Basis::new(vec![Coordinate::legendre(0.0, 1.0); 3], terms), coefficients)
    }

    fn close(found: &Matrix, expected: &Matrix) {
        assert_eq!((found.rows(), found.columns()), (expected.rows(), expected.columns()));
        for (x, y) in found.as_slice().iter().zip(expected.as_slice()) {
            assert!((x - y).abs() < 1e-12 * (1.0 + y.abs()), "{x} {y}");
        }
    }

    #[test]
    fn sparse_products_are_the_dense_ones() {
        let (basis, coefficients) = problem();
        let sparse = Sparse::of(&coefficients).unwrap();
        let mut rng = Stream::root(6).generator();
        let points = Matrix::from_fn(37, 3, |_, _| 2.0 * uniform(&mut rng) - 1.0);
        close(&sparse.mean(&basis, &points), &multiply(&basis.values(&points), &coefficients));
        for columns in [1, 3, 16, 21] {
            let factor = Matrix::from_fn(coefficients.rows(), columns, |_, _| normal(&mut rng));
            let dense = transposed_multiply(&coefficients, &factor);
            close(&sparse.transposed_multiply(&factor), &dense);
        }
    }

    #[test]
    fn the_bits_of_a_point_do_not_depend_on_the_others() {
        let (basis, coefficients) = problem();
        let sparse = Sparse::of(&coefficients).unwrap();
        let mut rng = Stream::root(7).generator();
        let points = Matrix::from_fn(50, 3, |_, _| 2.0 * uniform(&mut rng) - 1.0);
        let together = sparse.mean(&basis, &points);
        for size in [1, 2, 7, 16, 17, 33] {
            for first in (0..50).step_by(size) {
                let rows: Vec<usize> = (first..50.min(first + size)).collect();
                let apart = sparse.mean(&basis, &points.select_rows(&rows));
                assert_eq!(apart, together.select_rows(&rows), "{size} points from {first}");
            }
        }
    }

    #[test]
    fn what_is_mostly_full_stays_dense() {
        let full = Matrix::from_fn(8, 8, |i, j| f64::from(u8::from((i + j) % 4 != 0)));
        assert!(Sparse::of(&full).is_none());
        let quarter = Matrix::from_fn(8, 8, |i, j| f64::from(u8::from((i + j) % 4 == 0)));
        assert!(Sparse::of(&quarter).is_some());
    }
}
