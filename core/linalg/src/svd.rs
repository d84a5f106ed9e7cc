//! Singular value decomposition.

use faer::MatRef;

use crate::Matrix;
use crate::eigen::{column_signs, scale_column};
use crate::error::{Error, finite};
use crate::faer_view::{on_one_thread, view};

/// `A = U diag(values) V'` with `A` `m x n`, `U` `m x k` and `V` `n x k` with orthonormal columns,
/// `k = min(m, n)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Svd {
    /// `U`, `m x k`, with the signs that make the entry of largest magnitude in each column of `V` positive.
    pub u: Matrix,
    /// Singular values, decreasing.
    pub values: Vec<f64>,
    /// `V`, `n x k`.
    pub v: Matrix,
}

/// Thin singular value decomposition.
pub fn thin_svd(a: &Matrix) -> Result<Svd, Error> {
    finite(a)?;
    on_one_thread();
    let svd = view(a).thin_svd().map_err(|_| Error::NotConverged)?;
    let found: Vec<f64> =
        (0..a.rows().min(a.columns())).map(|i| svd.S().column_vector()[i]).collect();
    // For large matrices with singular values of zero the library returns some of these first.
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by(|&i, &j| found[j].total_cmp(&found[i]));
    let values = order.iter().map(|&i| found[i]).collect();
    let ordered =
        |all: MatRef<'_, f64>| Matrix::from_fn(all.nrows(), order.len(), |i, j| all[(i, order[j])]);
    let (mut u, mut v) = (ordered(svd.U()), ordered(svd.V()));
    for (j, sign) in column_signs(&v).into_iter().enumerate() {
        scale_column(&mut u, j, sign);
        scale_column(&mut v, j, sign);
    }
    Ok(Svd { u, values, v })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{gram, multiply_transposed, symmetric_eigen};

    #[test]
    fn factors_are_orthonormal_and_multiply_to_the_matrix() {
        for (m, n) in [(20, 6), (6, 20), (1, 3)] {
            let a = Matrix::from_fn(m, n, |i, j| ((i * i + 5 * j) as f64).sin());
            let Svd { u, values, v } = thin_svd(&a).unwrap();
            let k = m.min(n);
            assert_eq!((u.columns(), values.len(), v.columns()), (k, k, k));
            let scaled = Matrix::from_fn(m, k, |i, j| u[(i, j)] * values[j]);
            let back = multiply_transposed(&scaled, &v);
            assert!(back.as_slice().iter().zip(a.as_slice()).all(|(x, y)| (x - y).abs() < 1e-12));
            for factor in [u, v] {
                let g = gram(&factor);
                let unit = |i, j| f64::from(u8::from(i == j));
                assert!((0..k).all(|i| (0..k).all(|j| (g[(i, j)] - unit(i, j)).abs() < 1e-13)));
            }
        }
    }

    #[test]
    fn squares_are_the_eigenvalues_of_the_gram_matrix() {
        let a = Matrix::from_fn(15, 7, |i, j| 1.0 / (i + j + 1) as f64);
        let values = thin_svd(&a).unwrap().values;
        let squares = symmetric_eigen(&gram(&a)).unwrap().values;
        for (s, e) in values.iter().zip(squares.iter().rev()) {
            assert!((s * s - e).abs() < 1e-14);
        }
        assert!(values.is_sorted_by(|a, b| a >= b));
    }

    #[test]
    fn what_is_not_finite_is_refused() {
        let a = Matrix::from_rows(2, [[1.0, f64::NEG_INFINITY]]);
        assert_eq!(thin_svd(&a), Err(Error::NotFinite { row: 0, column: 1 }));
    }

    /// A thousand columns that are copies of ten, whose Gram matrix is a hundred times that of the ten.
    #[test]
    fn values_of_many_copies_are_in_order() {
        let function = |i: usize, j: usize| ((i * i + 5 * (j % 10)) as f64).sin();
        let whole = Matrix::from_fn(1001, 1000, function);
        let found = thin_svd(&whole).unwrap();
        let few = symmetric_eigen(&gram(&Matrix::from_fn(1001, 10, function))).unwrap().values;
        let mut expected: Vec<f64> = few.iter().map(|x| (100.0 * x.max(0.0)).sqrt()).collect();
        expected.sort_by(|a, b| b.total_cmp(a));
        for (value, expected) in found.values.iter().zip(&expected) {
            assert!((value - expected).abs() < 1e-5 * found.values[0], "{value} {expected}");
        }
        assert!(found.values.windows(2).all(|pair| pair[0] >= pair[1]));
    }
}
