//! Matrix products.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Par};

use crate::Matrix;
use crate::faer_view::{view, view_mut};
use crate::triangular::tiles_of_lower;

/// `A B`: `m x k` by `k x n` gives `m x n`.
///
/// # Panics
/// When the inner sizes differ.
pub fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    assert_eq!(a.columns(), b.rows(), "inner sizes of a product");
    let mut product = Matrix::zeros(a.rows(), b.columns());
    matmul(view_mut(&mut product), Accum::Replace, view(a), view(b), 1.0, Par::Seq);
    product
}

/// Width of a block of columns: wide enough for the products to run at full speed, narrow enough to skip most zeros.
const WIDTH: usize = 96;

/// `A L`: `m x k` by `k x n` gives `m x n`, for `L` with zeros above its diagonal, which are skipped.
///
/// # Panics
/// When the inner sizes differ.
pub fn multiply_lower(a: &Matrix, l: &Matrix) -> Matrix {
    assert_eq!(a.columns(), l.rows(), "inner sizes of a product");
    let (inner, columns) = (l.rows(), l.columns());
    let mut product = Matrix::zeros(a.rows(), columns);
    // Rows above `first` are zero in this block of columns.
    for first in (0..columns.min(inner)).step_by(WIDTH) {
        let width = WIDTH.min(columns - first);
        matmul(
            view_mut(&mut product).subcols_mut(first, width),
            Accum::Replace,
            view(a).subcols(first, inner - first),
            view(l).submatrix(first, first, inner - first, width),
            1.0,
            Par::Seq,
        );
    }
    product
}

/// `A' B`: `k x m` by `k x n` gives `m x n`.
///
/// # Panics
/// When the inner sizes differ.
pub fn transposed_multiply(a: &Matrix, b: &Matrix) -> Matrix {
    assert_eq!(a.rows(), b.rows(), "inner sizes of a product");
    let mut product = Matrix::zeros(a.columns(), b.columns());
    matmul(view_mut(&mut product), Accum::Replace, view(a).transpose(), view(b), 1.0, Par::Seq);
    product
}

/// `A B'`: `m x k` by `n x k` gives `m x n`.
///
/// # Panics
/// When the inner sizes differ.
pub fn multiply_transposed(a: &Matrix, b: &Matrix) -> Matrix {
    assert_eq!(a.columns(), b.columns(), "inner sizes of a product");
    let mut product = Matrix::zeros(a.rows(), b.rows());
    matmul(view_mut(&mut product), Accum::Replace, view(a), view(b).transpose(), 1.0, Par::Seq);
    product
}

/// `A' A`: `m x n` gives `n x n`, exactly symmetric.
pub fn gram(a: &Matrix) -> Matrix {
    gram_of(a, BlockStructure::Rectangular, BlockStructure::Rectangular)
}

/// `L' L` for a square `L` with zeros above its diagonal, which are skipped; exactly symmetric.
///
/// # Panics
/// When `L` is not square.
pub fn gram_lower(l: &Matrix) -> Matrix {
    gram_of(l, BlockStructure::TriangularUpper, BlockStructure::TriangularLower)
}

fn gram_of(a: &Matrix, left: BlockStructure, right: BlockStructure) -> Matrix {
    let n = a.columns();
    let mut product = Matrix::zeros(n, n);
    triangular::matmul(
        view_mut(&mut product),
        BlockStructure::TriangularLower,
        Accum::Replace,
        view(a).transpose(),
        left,
        view(a),
        right,
        1.0,
        Par::Seq,
    );
    for (rows, columns) in tiles_of_lower(n) {
        for i in rows {
            for j in columns.start..columns.end.min(i) {
                product[(j, i)] = product[(i, j)];
            }
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{multiply_vector, transposed_multiply_vector};

    /// Reference: the definition, entry by entry.
    fn plain(a: &Matrix, b: &Matrix) -> Matrix {
        Matrix::from_fn(a.rows(), b.columns(), |i, j| {
            (0..a.columns()).map(|k| a[(i, k)] * b[(k, j)]).sum()
        })
    }

    fn wavy(rows: usize, columns: usize, phase: f64) -> Matrix {
        Matrix::from_fn(rows, columns, |i, j| ((i * columns + j) as f64 * 0.7 + phase).sin())
    }

    fn close(a: &Matrix, b: &Matrix) {
        assert_eq!((a.rows(), a.columns()), (b.rows(), b.columns()));
        let worst =
            a.as_slice().iter().zip(b.as_slice()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-12, "{worst}");
    }

    #[test]
    fn products_with_lower_matrices_skip_nothing_but_zeros() {
        for (m, k, n) in [(3, 5, 5), (7, 300, 250), (30, 200, 97), (4, 90, 200), (2, 0, 3)] {
            let a = wavy(m, k, 0.4);
            let full = wavy(k, n, 0.2);
            let l = Matrix::from_fn(k, n, |i, j| if i < j { 0.0 } else { full[(i, j)] });
            close(&multiply_lower(&a, &l), &plain(&a, &l));
            let square: Vec<usize> = (0..k.min(n)).collect();
            let l = l.select_rows(&square).select_columns(&square);
            close(&gram_lower(&l), &plain(&l.transposed(), &l));
        }
    }

    #[test]
    fn products_agree_with_their_definition() {
        for (m, k, n) in [(1, 1, 1), (3, 5, 2), (40, 17, 33), (0, 3, 2), (2, 0, 3)] {
            let (a, b) = (wavy(m, k, 0.1), wavy(k, n, 0.9));
            close(&multiply(&a, &b), &plain(&a, &b));
            close(&transposed_multiply(&a.transposed(), &b), &plain(&a, &b));
            close(&multiply_transposed(&a, &b.transposed()), &plain(&a, &b));
            close(&gram(&a), &plain(&a.transposed(), &a));
            let x = wavy(k, 1, 0.3);
            close(&Matrix::from_vec(m, 1, multiply_vector(&a, x.as_slice())), &plain(&a, &x));
            let z = wavy(m, 1, 0.2);
            close(
                &Matrix::from_vec(k, 1, transposed_multiply_vector(&a, z.as_slice())),
                &plain(&a.transposed(), &z),
            );
        }
    }
}
