//! QR factorisation and least squares.

use crate::error::{Error, finite};
use crate::faer_view::{copied, on_one_thread, view};
use crate::triangular::solve_upper_matrix;
use crate::{Matrix, transposed_multiply};

/// `A = Q R` with `A` `m x n`, `Q` `m x k` with orthonormal columns, `R` `k x n` upper trapezoidal,
/// `k = min(m, n)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Qr {
    /// `Q`, `m x k`.
    pub q: Matrix,
    /// `R`, `k x n`.
    pub r: Matrix,
}

/// Thin QR factorisation by Householder reflections; the signs of `R`'s diagonal are arbitrary.
pub fn thin_qr(a: &Matrix) -> Result<Qr, Error> {
    finite(a)?;
    on_one_thread();
    let qr = view(a).qr();
    Ok(Qr { q: copied(qr.compute_thin_Q().as_ref()), r: upper(&copied(qr.thin_R())) })
}

/// The factor `R` of [`thin_qr`] alone, in half of the time.
pub fn triangular_factor(a: &Matrix) -> Result<Matrix, Error> {
    finite(a)?;
    on_one_thread();
    Ok(upper(&copied(view(a).qr().thin_R())))
}

fn upper(r: &Matrix) -> Matrix {
    Matrix::from_fn(r.rows(), r.columns(), |i, j| if i <= j { r[(i, j)] } else { 0.0 })
}

/// Result of [`least_squares`].
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquares {
    /// Coefficients `X`, `n x p`; zero for columns that depend on others.
    pub solution: Matrix,
    /// Number of columns of `A` that are independent to working precision.
    pub rank: usize,
}

/// Minimises `|A X - B|` column by column, with `A` `m x n` and `B` `m x p`, by a column-pivoted QR.
///
/// A column counts as dependent if its pivot is below `max(m, n)` times the unit round-off times the first pivot (Golub
/// and Van Loan, Matrix Computations, 5.5.7). The solution is then the basic one, with as many nonzero rows as the
/// rank.
///
/// # Panics
/// If `A` and `B` have different numbers of rows.
pub fn least_squares(a: &Matrix, b: &Matrix) -> Result<LeastSquares, Error> {
    assert_eq!(a.rows(), b.rows(), "as many equations as right-hand sides");
    finite(a)?;
    finite(b)?;
    on_one_thread();
    let qr = view(a).col_piv_qr();
    let r = copied(qr.thin_R());
    let size = r.rows();
    let tolerance = if size == 0 {
        0.0
    } else {
        r[(0, 0)].abs() * f64::EPSILON * a.rows().max(a.columns()) as f64
    };
    let rank = (0..size).take_while(|&i| r[(i, i)].abs() > tolerance).count();
    let projected = transposed_multiply(&copied(qr.compute_thin_Q().as_ref()), b);
    let leading: Vec<usize> = (0..rank).collect();
    // Basic solution: the coefficients of dependent columns remain zero.
    let mut basic = projected.select_rows(&leading);
    solve_upper_matrix(&Matrix::from_fn(rank, rank, |i, j| r[(i, j)]), &mut basic);
    let mut solution = Matrix::zeros(a.columns(), b.columns());
    let (forward, _) = qr.P().arrays();
    for (i, row) in basic.iter_rows().enumerate() {
        solution.row_mut(forward[i]).copy_from_slice(row);
    }
    Ok(LeastSquares { solution, rank })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{gram, multiply};

    fn wavy(rows: usize, columns: usize) -> Matrix {
        Matrix::from_fn(rows, columns, |i, j| ((i * i + 3 * j * i + j) as f64).sin())
    }

    fn close(a: &Matrix, b: &Matrix, tolerance: f64) {
        assert!(a.as_slice().iter().zip(b.as_slice()).all(|(x, y)| (x - y).abs() < tolerance));
    }

    #[test]
    fn factors_are_orthonormal_and_triangular_and_multiply_to_the_matrix() {
        for (m, n) in [(1, 1), (30, 8), (8, 30), (64, 64)] {
            let a = wavy(m, n);
            let Qr { q, r } = thin_qr(&a).unwrap();
            let k = m.min(n);
            assert_eq!((q.rows(), q.columns(), r.rows(), r.columns()), (m, k, k, n));
            close(&multiply(&q, &r), &a, 1e-12);
            let unit = Matrix::from_fn(k, k, |i, j| f64::from(u8::from(i == j)));
            close(&gram(&q), &unit, 1e-13);
            assert!((0..k).all(|i| (0..i).all(|j| r[(i, j)] == 0.0)));
        }
    }

    #[test]
    fn the_line_through_points_has_its_closed_form() {
        // Source: slope = cov(t, y) / var(t) for t = 0, 1, 2, 3 and y = 1, 3, 2, 5: 5.5 / 5.
        let a = Matrix::from_fn(4, 2, |i, j| if j == 0 { 1.0 } else { i as f64 });
        let b = Matrix::from_vec(4, 1, vec![1.0, 3.0, 2.0, 5.0]);
        let fit = least_squares(&a, &b).unwrap();
        assert_eq!(fit.rank, 2);
        assert!((fit.solution[(1, 0)] - 1.1).abs() < 1e-14);
        assert!((fit.solution[(0, 0)] - (2.75 - 1.1 * 1.5)).abs() < 1e-14);
    }

    #[test]
    fn residuals_are_orthogonal_to_the_columns() {
        let (a, b) = (wavy(50, 12), Matrix::from_fn(50, 3, |i, j| ((i * (j + 2)) as f64).cos()));
        let fit = least_squares(&a, &b).unwrap();
        let model = multiply(&a, &fit.solution);
        let residual = Matrix::from_fn(50, 3, |i, j| b[(i, j)] - model[(i, j)]);
        close(&transposed_multiply(&a, &residual), &Matrix::zeros(12, 3), 1e-12);
    }

    #[test]
    fn dependent_columns_lower_the_rank_and_keep_the_fit() {
        let half = wavy(40, 5);
        let a = Matrix::from_fn(40, 10, |i, j| half[(i, j % 5)] * if j < 5 { 1.0 } else { -2.0 });
        let b = multiply(&half, &Matrix::from_fn(5, 1, |i, _| i as f64 - 2.0));
        let fit = least_squares(&a, &b).unwrap();
        assert_eq!(fit.rank, 5);
        close(&multiply(&a, &fit.solution), &b, 1e-11);
        assert_eq!(least_squares(&Matrix::zeros(3, 2), &wavy(3, 1)).unwrap().rank, 0);
    }

    #[test]
    fn what_is_not_finite_is_refused() {
        let mut a = wavy(4, 2);
        a[(3, 1)] = f64::INFINITY;
        assert_eq!(thin_qr(&a), Err(Error::NotFinite { row: 3, column: 1 }));
        assert_eq!(
            least_squares(&wavy(4, 2), &a.select_columns(&[1])),
            Err(Error::NotFinite { row: 3, column: 0 })
        );
    }
}
