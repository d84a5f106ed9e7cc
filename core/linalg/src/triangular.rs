//! Triangular systems. Only the named triangle of the matrix is read.

use std::ops::Range;

use faer::Par;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};

use crate::faer_view::{view, view_mut};
use crate::{Matrix, vector};

fn check(a: &Matrix, length: usize) {
    assert!(a.rows() == a.columns() && a.rows() == length, "a square matrix of the vector's size");
}

/// Solves `L x = b` in place, `L` lower triangular `n x n`.
///
/// # Panics
/// When the sizes differ.
pub fn solve_lower(l: &Matrix, b: &mut [f64]) {
    check(l, b.len());
    for i in 0..b.len() {
        let row = l.row(i);
        b[i] = (b[i] - vector::dot(&row[..i], &b[..i])) / row[i];
    }
}

/// Solves `L' x = b` in place, `L` lower triangular `n x n`.
///
/// # Panics
/// When the sizes differ.
pub fn solve_lower_transposed(l: &Matrix, b: &mut [f64]) {
    check(l, b.len());
    for i in (0..b.len()).rev() {
        let row = l.row(i);
        b[i] /= row[i];
        let x = b[i];
        vector::add_scaled(&mut b[..i], -x, &row[..i]);
    }
}

/// Solves `U x = b` in place, `U` upper triangular `n x n`.
///
/// # Panics
/// When the sizes differ.
pub fn solve_upper(u: &Matrix, b: &mut [f64]) {
    check(u, b.len());
    for i in (0..b.len()).rev() {
        let row = u.row(i);
        b[i] = (b[i] - vector::dot(&row[i + 1..], &b[i + 1..])) / row[i];
    }
}

/// Solves `U' x = b` in place, `U` upper triangular `n x n`.
///
/// # Panics
/// When the sizes differ.
pub fn solve_upper_transposed(u: &Matrix, b: &mut [f64]) {
    check(u, b.len());
    for i in 0..b.len() {
        let row = u.row(i);
        b[i] /= row[i];
        let x = b[i];
        vector::add_scaled(&mut b[i + 1..], -x, &row[i + 1..]);
    }
}

/// Solves `L X = B` in place, `L` lower triangular `n x n`, `B` `n x m`.
///
/// # Panics
/// When the sizes differ.
pub fn solve_lower_matrix(l: &Matrix, b: &mut Matrix) {
    check(l, b.rows());
    solve_lower_triangular_in_place(view(l), view_mut(b), Par::Seq);
}

/// Solves `U X = B` in place, `U` upper triangular `n x n`, `B` `n x m`.
///
/// # Panics
/// When the sizes differ.
pub fn solve_upper_matrix(u: &Matrix, b: &mut Matrix) {
    check(u, b.rows());
    solve_upper_triangular_in_place(view(u), view_mut(b), Par::Seq);
}

/// The square tiles, as rows and columns, that cover the lower triangle of an `n x n` matrix. The rows and the columns of a
/// tile stay in the cache together; a transposed copy along whole rows would miss it at each entry.
pub(crate) fn tiles_of_lower(n: usize) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
    const SIDE: usize = 32;
    let range = move |tile: usize| tile * SIDE..((tile + 1) * SIDE).min(n);
    (0..n.div_ceil(SIDE)).flat_map(move |i| (0..=i).map(move |j| (range(i), range(j))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{multiply, multiply_vector};

    type Solve = fn(&Matrix, &mut [f64]);

    #[test]
    fn solutions_give_back_the_right_hand_sides() {
        let n = 37;
        // The other triangle holds NaN to prove that it is not read.
        let entry = |i: usize, j: usize| {
            if i == j { 3.0 + (i as f64).sin() } else { ((i * 31 + j) as f64).cos() / 8.0 }
        };
        let lower = Matrix::from_fn(n, n, |i, j| if j <= i { entry(i, j) } else { f64::NAN });
        let upper = Matrix::from_fn(n, n, |i, j| if j >= i { entry(i, j) } else { f64::NAN });
        let clean = |m: &Matrix| {
            Matrix::from_fn(n, n, |i, j| if m[(i, j)].is_nan() { 0.0 } else { m[(i, j)] })
        };
        let b: Vec<f64> = (0..n).map(|i| (i as f64 * 0.4).sin()).collect();
        let cases: [(Solve, &Matrix, Matrix); 4] = [
            (solve_lower, &lower, clean(&lower)),
            (solve_lower_transposed, &lower, clean(&lower).transposed()),
            (solve_upper, &upper, clean(&upper)),
            (solve_upper_transposed, &upper, clean(&upper).transposed()),
        ];
        for (solve, stored, meant) in cases {
            let mut x = b.clone();
            solve(stored, &mut x);
            let back = multiply_vector(&meant, &x);
            assert!(back.iter().zip(&b).all(|(p, q)| (p - q).abs() < 1e-12));
        }
        let right = Matrix::from_fn(n, 3, |i, j| (i as f64 + 10.0 * j as f64).sin());
        for (solve, m) in
            [(solve_lower_matrix as fn(&Matrix, &mut Matrix), &lower), (solve_upper_matrix, &upper)]
        {
            let mut x = right.clone();
            solve(m, &mut x);
            let back = multiply(&clean(m), &x);
            assert!(
                back.as_slice().iter().zip(right.as_slice()).all(|(p, q)| (p - q).abs() < 1e-12)
            );
        }
    }
}
