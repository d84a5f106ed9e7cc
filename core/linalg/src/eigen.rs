//! Eigenvalues of symmetric matrices.

use faer::Side;

use crate::Matrix;
use crate::error::{Error, finite};
use crate::faer_view::{copied, on_one_thread, view};

/// `A = V diag(values) V'` with `V` orthogonal.
#[derive(Debug, Clone, PartialEq)]
pub struct SymmetricEigen {
    /// Eigenvalues, increasing.
    pub values: Vec<f64>,
    /// `V`, `n x n`: column `j` is the eigenvector of value `j`; its entry of largest magnitude is positive.
    pub vectors: Matrix,
}

/// Eigendecomposition of a symmetric `n x n` matrix, of which only the lower triangle is read.
///
/// # Panics
/// If the matrix is not square.
pub fn symmetric_eigen(a: &Matrix) -> Result<SymmetricEigen, Error> {
    assert_eq!(a.rows(), a.columns(), "a square matrix");
    finite(a)?;
    on_one_thread();
    let eigen = view(a).self_adjoint_eigen(Side::Lower).map_err(|_| Error::NotConverged)?;
    let values = (0..a.rows()).map(|i| eigen.S().column_vector()[i]).collect();
    let mut vectors = copied(eigen.U());
    for (j, sign) in column_signs(&vectors).into_iter().enumerate() {
        scale_column(&mut vectors, j, sign);
    }
    Ok(SymmetricEigen { values, vectors })
}

/// For each column, the sign of its entry of largest magnitude (the first one of several).
pub(crate) fn column_signs(a: &Matrix) -> Vec<f64> {
    let sign = |j: usize| {
        let largest = (0..a.rows())
            .map(|i| a[(i, j)])
            .fold(0.0_f64, |best, x| if x.abs() > best.abs() { x } else { best });
        if largest < 0.0 { -1.0 } else { 1.0 }
    };
    (0..a.columns()).map(sign).collect()
}

pub(crate) fn scale_column(a: &mut Matrix, j: usize, factor: f64) {
    for i in 0..a.rows() {
        a[(i, j)] *= factor;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_second_difference_has_its_closed_form() {
        // Source: the eigenvalues of tridiagonal (-1, 2, -1) are 2 - 2 cos(k pi / (n + 1)), k = 1..n,
        // the vectors sin(i k pi / (n + 1)) (Golub and Van Loan, Matrix Computations, 4.8.6).
        let n = 24;
        let a = Matrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        });
        let eigen = symmetric_eigen(&a).unwrap();
        for k in 0..n {
            let angle = (k + 1) as f64 * std::f64::consts::PI / (n + 1) as f64;
            assert!((eigen.values[k] - (2.0 - 2.0 * angle.cos())).abs() < 1e-13);
            let scale = (2.0 / (n + 1) as f64).sqrt();
            for i in 0..n {
                let expected = scale * ((i + 1) as f64 * angle).sin();
                assert!((eigen.vectors[(i, k)].abs() - expected.abs()).abs() < 1e-12);
            }
        }
        assert!(column_signs(&eigen.vectors).iter().all(|&s| s > 0.0));
    }

    #[test]
    fn what_is_not_finite_is_refused() {
        let a = Matrix::from_rows(2, [[1.0, 0.0], [f64::NAN, 1.0]]);
        assert_eq!(symmetric_eigen(&a), Err(Error::NotFinite { row: 1, column: 0 }));
    }
}
