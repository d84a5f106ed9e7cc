//! Products of a matrix and a vector.

use super::{Matrix, vector};

/// `A x`: `m x n` times `n` gives `m`.
///
/// # Panics
/// If the inner sizes differ.
pub fn multiply_vector(a: &Matrix, x: &[f64]) -> Vec<f64> {
    assert_eq!(a.columns(), x.len(), "inner sizes of a product");
    a.iter_rows().map(|row| vector::dot(row, x)).collect()
}

/// `A' x`: `m x n` and `m` give `n`.
///
/// # Panics
/// If the inner sizes differ.
pub fn transposed_multiply_vector(a: &Matrix, x: &[f64]) -> Vec<f64> {
    assert_eq!(a.rows(), x.len(), "inner sizes of a product");
    let mut product = vec![0.0; a.columns()];
    for (row, &weight) in a.iter_rows().zip(x) {
        vector::add_scaled(&mut product, weight, row);
    }
    product
}
