//! Upper triangular matrices that grow by columns.

use faer::traits::pulp::Arch;

use crate::vector::{add_scaled_inline, dot_inline};

/// An upper triangular `n x n` matrix to which columns are appended, stored column after column
/// without the zeros: the shape of factors that are updated one column at a time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PackedUpper {
    size: usize,
    data: Vec<f64>,
}

impl PackedUpper {
    /// The matrix without columns.
    pub fn new() -> Self {
        Self::default()
    }

    /// `n`.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Column `j` down to the diagonal: `j + 1` entries.
    pub fn column(&self, j: usize) -> &[f64] {
        &self.data[j * (j + 1) / 2..(j + 1) * (j + 2) / 2]
    }

    /// Appends a column down to the diagonal.
    ///
    /// # Panics
    /// When it has not `n + 1` entries.
    pub fn push(&mut self, column: &[f64]) {
        assert_eq!(column.len(), self.size + 1, "a column reaches down to the diagonal");
        self.data.extend_from_slice(column);
        self.size += 1;
    }

    /// `U x`.
    ///
    /// # Panics
    /// When `x` has not `n` entries.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.size, "a vector of the matrix' size");
        let mut product = vec![0.0; self.size];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (j, x) in x.iter().enumerate() {
                    add_scaled_inline(&mut product[..=j], *x, self.column(j));
                }
            },
        );
        product
    }

    /// `U' x`.
    ///
    /// # Panics
    /// When `x` has not `n` entries.
    pub fn transposed_multiply(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.size, "a vector of the matrix' size");
        let mut product = vec![0.0; self.size];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (j, product) in product.iter_mut().enumerate() {
                    *product = dot_inline(self.column(j), &x[..=j]);
                }
            },
        );
        product
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_agree_with_their_definition() {
        let entry = |i: usize, j: usize| ((3 * i + 7 * j) as f64).sin();
        let n = 45;
        let mut upper = PackedUpper::new();
        for j in 0..n {
            upper.push(&(0..=j).map(|i| entry(i, j)).collect::<Vec<_>>());
        }
        let x: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let (plain, transposed) = (upper.multiply(&x), upper.transposed_multiply(&x));
        for i in 0..n {
            let row: f64 = (i..n).map(|j| entry(i, j) * x[j]).sum();
            let column: f64 = (0..=i).map(|j| entry(j, i) * x[j]).sum();
            assert!((plain[i] - row).abs() < 1e-12 && (transposed[i] - column).abs() < 1e-12);
        }
        assert_eq!(upper.size(), n);
    }
}
