//! Cholesky factorisation of symmetric positive definite matrices.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{
    LltError, LltRegularization, cholesky_in_place, cholesky_in_place_scratch,
};
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::{Mat, Par, Spec};

use crate::error::{Error, finite};
use crate::faer_view::{view, view_mut};
use crate::triangular::{solve_lower, solve_lower_matrix, solve_lower_transposed, tiles_of_lower};
use crate::{Matrix, vector};

/// The factorisation `A = L L'`, with `L` lower triangular and a positive diagonal.
#[derive(Debug, Clone, PartialEq)]
pub struct Cholesky {
    lower: Matrix,
}

impl Cholesky {
    /// Factors a symmetric positive definite `n x n` matrix, of which only the lower triangle is read.
    ///
    /// # Panics
    /// If the matrix is not square.
    ///
    /// # Errors
    /// If an entry is not finite, or the matrix is not positive definite.
    pub fn new(a: &Matrix) -> Result<Self, Error> {
        assert_eq!(a.rows(), a.columns(), "a square matrix");
        finite(a)?;
        let n = a.rows();
        let mut factor = columns_of_lower(a);
        let scratch = cholesky_in_place_scratch::<f64>(n, Par::Seq, Spec::default());
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        cholesky_in_place(
            factor.as_mut(),
            LltRegularization::default(),
            Par::Seq,
            stack,
            Spec::default(),
        )
        .map_err(|LltError::NonPositivePivot { index }| Error::NotPositiveDefinite {
            pivot: index,
        })?;
        Ok(Self { lower: rows_of_lower(&factor) })
    }

    /// The factorisation with the given lower factor `L`, whose diagonal is positive.
    ///
    /// # Panics
    /// If the factor is not square.
    pub fn from_lower(lower: Matrix) -> Self {
        assert_eq!(lower.rows(), lower.columns(), "a square matrix");
        Self { lower }
    }

    /// Size `n` of the matrix.
    pub fn size(&self) -> usize {
        self.lower.rows()
    }

    /// `L`, `n x n`, zero above the diagonal.
    pub fn lower(&self) -> &Matrix {
        &self.lower
    }

    /// `log det A`.
    pub fn log_determinant(&self) -> f64 {
        2.0 * (0..self.size()).map(|i| self.lower[(i, i)].ln()).sum::<f64>()
    }

    /// Replaces `b` by `A^-1 b`.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn solve(&self, b: &mut [f64]) {
        solve_lower(&self.lower, b);
        solve_lower_transposed(&self.lower, b);
    }

    /// Replaces `b` by `L^-1 b`, which whitens it: if `b` has covariance `A`, the result has unit covariance.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn whiten(&self, b: &mut [f64]) {
        solve_lower(&self.lower, b);
    }

    /// `L z`: has covariance `A` if `z` has unit covariance.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn colour(&self, z: &[f64]) -> Vec<f64> {
        assert_eq!(z.len(), self.size(), "a vector of the matrix' size");
        (0..z.len()).map(|i| vector::dot(&self.lower.row(i)[..=i], &z[..=i])).collect()
    }

    /// `b' A^-1 b`.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn quadratic(&self, b: &[f64]) -> f64 {
        let mut white = b.to_vec();
        self.whiten(&mut white);
        vector::dot(&white, &white)
    }

    /// `L^-1 B` for `B` `n x m`.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn whiten_matrix(&self, b: &Matrix) -> Matrix {
        let mut white = b.clone();
        solve_lower_matrix(&self.lower, &mut white);
        white
    }

    /// `A^-1 B` for `B` `n x m`.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn solve_matrix(&self, b: &Matrix) -> Matrix {
        let mut solution = self.whiten_matrix(b);
        crate::triangular::solve_upper_matrix(&self.lower.transposed(), &mut solution);
        solution
    }

    /// `L^-1`, `n x n`, zero above the diagonal.
    pub fn lower_inverse(&self) -> Matrix {
        let n = self.size();
        let mut inverse = Matrix::zeros(n, n);
        invert_lower_triangular(view_mut(&mut inverse), view(&self.lower), Par::Seq);
        inverse
    }

    /// `A^-1`, `n x n`, exactly symmetric.
    pub fn inverse(&self) -> Matrix {
        crate::gram_lower(&self.lower_inverse())
    }

    /// The factorisation of `A` bordered by one more row and column, in `n^2` operations.
    ///
    /// `border` holds the new row: the `n` entries beside `A`, then the new diagonal entry.
    ///
    /// # Panics
    /// If `border` does not have `n + 1` entries.
    pub fn bordered(&self, border: &[f64]) -> Result<Self, Error> {
        let n = self.size();
        assert_eq!(border.len(), n + 1, "the border has one entry more than the matrix has rows");
        if let Some(column) = border.iter().position(|x| !x.is_finite()) {
            return Err(Error::NotFinite { row: n, column });
        }
        let mut row = border.to_vec();
        solve_lower(&self.lower, &mut row[..n]);
        let pivot = row[n] - vector::dot(&row[..n], &row[..n]);
        if pivot <= 0.0 {
            return Err(Error::NotPositiveDefinite { pivot: n });
        }
        row[n] = pivot.sqrt();
        let mut lower = Matrix::zeros(n + 1, n + 1);
        for i in 0..n {
            lower.row_mut(i)[..n].copy_from_slice(self.lower.row(i));
        }
        lower.row_mut(n).copy_from_slice(&row);
        Ok(Self { lower })
    }
}

/// The lower triangle of a matrix whose rows are contiguous, as one whose columns are; zero above the diagonal.
fn columns_of_lower(a: &Matrix) -> Mat<f64> {
    let n = a.rows();
    let mut copy = Mat::zeros(n, n);
    for (rows, columns) in tiles_of_lower(n) {
        for j in columns {
            let first = rows.start.max(j);
            let own = a.as_slice()[first * n + j..].iter().step_by(n);
            let column = &mut copy.col_as_slice_mut(j)[first..rows.end];
            column.iter_mut().zip(own).for_each(|(to, from)| *to = *from);
        }
    }
    copy
}

/// The lower triangle of a matrix whose columns are contiguous, as one whose rows are; zero above the diagonal.
fn rows_of_lower(a: &Mat<f64>) -> Matrix {
    let n = a.nrows();
    let mut copy = Matrix::zeros(n, n);
    for (rows, columns) in tiles_of_lower(n) {
        for j in columns {
            let first = rows.start.max(j);
            let own = &a.col_as_slice(j)[first..rows.end];
            let row = copy.as_mut_slice()[first * n + j..].iter_mut().step_by(n);
            row.zip(own).for_each(|(to, from)| *to = *from);
        }
    }
    copy
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{multiply, multiply_transposed};

    /// `min(i, j)`, the covariance of a random walk: its factor is all ones, its determinant 1 and its
    /// inverse tridiagonal with 2 on the diagonal (1 at the end) and -1 beside it.
    fn walk(n: usize) -> Matrix {
        Matrix::from_fn(n, n, |i, j| (i.min(j) + 1) as f64)
    }

    #[test]
    fn the_random_walk_has_its_closed_forms() {
        for n in [1, 2, 7, 60] {
            let cholesky = Cholesky::new(&walk(n)).unwrap();
            for i in 0..n {
                for j in 0..n {
                    assert!((cholesky.lower()[(i, j)] - f64::from(u8::from(j <= i))).abs() < 1e-12);
                }
            }
            assert!(cholesky.log_determinant().abs() < 1e-12);
            let inverse = cholesky.inverse();
            for i in 0..n {
                for j in 0..n {
                    let expected = match i.abs_diff(j) {
                        0 if i + 1 == n => 1.0,
                        0 => 2.0,
                        1 => -1.0,
                        _ => 0.0,
                    };
                    assert!((inverse[(i, j)] - expected).abs() < 1e-10);
                }
            }
        }
    }

    #[test]
    fn the_factor_has_the_bits_of_the_solver_of_faer() {
        for n in [1, 2, 31, 32, 33, 100, 200] {
            let a = Matrix::from_fn(n, n, |i, j| (-0.1 * i.abs_diff(j) as f64).exp());
            let solver = view(&a).llt(faer::Side::Lower).unwrap();
            let lower = Cholesky::new(&a).unwrap().lower;
            for i in 0..n {
                for j in 0..n {
                    let expected = if j <= i { solver.L()[(i, j)] } else { 0.0 };
                    assert_eq!(lower[(i, j)].to_bits(), expected.to_bits(), "n = {n}, ({i}, {j})");
                }
            }
        }
    }

    #[test]
    fn solutions_satisfy_their_systems() {
        let n = 23;
        let l = Matrix::from_fn(n, n, |i, j| match i.cmp(&j) {
            std::cmp::Ordering::Equal => 2.0 + (i as f64).sin(),
            std::cmp::Ordering::Greater => ((i * n + j) as f64).sin() / 3.0,
            std::cmp::Ordering::Less => 0.0,
        });
        let a = multiply_transposed(&l, &l);
        let cholesky = Cholesky::new(&a).unwrap();
        let b: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let mut x = b.clone();
        cholesky.solve(&mut x);
        let residual = crate::multiply_vector(&a, &x);
        assert!(residual.iter().zip(&b).all(|(p, q)| (p - q).abs() < 1e-11));
        assert!((cholesky.quadratic(&b) - vector::dot(&b, &x)).abs() < 1e-11);
        let mut white = b.clone();
        cholesky.whiten(&mut white);
        assert!(cholesky.colour(&white).iter().zip(&b).all(|(p, q)| (p - q).abs() < 1e-12));
        let right = Matrix::from_fn(n, 4, |i, j| ((i + 5 * j) as f64).sin());
        let back = multiply(&a, &cholesky.solve_matrix(&right));
        assert!(back.as_slice().iter().zip(right.as_slice()).all(|(p, q)| (p - q).abs() < 1e-11));
    }

    #[test]
    fn a_bordered_factorisation_is_that_of_the_bordered_matrix() {
        let (small, large) = (Cholesky::new(&walk(9)).unwrap(), Cholesky::new(&walk(10)).unwrap());
        let grown = small.bordered(walk(10).row(9)).unwrap();
        let pairs = grown.lower().as_slice().iter().zip(large.lower().as_slice());
        assert!(pairs.into_iter().all(|(p, q)| (p - q).abs() < 1e-13));
        let mut singular = walk(10).row(8).to_vec();
        singular[9] = 9.0;
        assert_eq!(small.bordered(&singular), Err(Error::NotPositiveDefinite { pivot: 9 }));
    }

    #[test]
    fn what_cannot_be_factored_is_refused() {
        let indefinite = Matrix::from_rows(2, [[1.0, 2.0], [2.0, 1.0]]);
        assert_eq!(Cholesky::new(&indefinite), Err(Error::NotPositiveDefinite { pivot: 1 }));
        let mut broken = walk(3);
        broken[(2, 1)] = f64::NAN;
        assert_eq!(Cholesky::new(&broken), Err(Error::NotFinite { row: 2, column: 1 }));
    }
}
