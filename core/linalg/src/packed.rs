//! Upper triangular matrices that grow by columns.
#![allow(clippy::inline_always)]

use faer::traits::pulp::{Arch, Simd, WithSimd};

const LANES: usize = 8;

/// An upper triangular `n x n` matrix to which columns are appended, stored column after column
/// without most of the zeros: the shape of factors that are updated one column at a time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PackedUpper {
    /// Columns down to the diagonal, filled up with zeros to whole lanes: short columns are many, and
    /// a remainder would cost more than the column.
    lanes: Vec<[f64; LANES]>,
    /// Where each column begins, and where the last one ends.
    starts: Vec<usize>,
}

impl PackedUpper {
    /// The matrix without columns.
    pub fn new() -> Self {
        Self { lanes: Vec::new(), starts: vec![0] }
    }

    /// `n`.
    pub fn size(&self) -> usize {
        self.starts.len() - 1
    }

    /// Column `j` down to the diagonal: `j + 1` entries.
    pub fn column(&self, j: usize) -> &[f64] {
        &self.padded(j).as_flattened()[..=j]
    }

    fn padded(&self, j: usize) -> &[[f64; LANES]] {
        &self.lanes[self.starts[j]..self.starts[j + 1]]
    }

    /// Appends a column down to the diagonal.
    ///
    /// # Panics
    /// When it has not `n + 1` entries.
    pub fn push(&mut self, column: &[f64]) {
        assert_eq!(column.len(), self.size() + 1, "a column reaches down to the diagonal");
        self.lanes.extend(in_lanes(column));
        self.starts.push(self.lanes.len());
    }

    /// `U x`.
    ///
    /// # Panics
    /// When `x` has not `n` entries.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.size(), "a vector of the matrix' size");
        let mut product = vec![[0.0; LANES]; x.len().div_ceil(LANES)];
        Arch::new().dispatch(Multiply { upper: self, x, product: &mut product });
        let mut product = product.as_flattened().to_vec();
        product.truncate(x.len());
        product
    }

    /// `U' x`.
    ///
    /// # Panics
    /// When `x` has not `n` entries.
    pub fn transposed_multiply(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.size(), "a vector of the matrix' size");
        let x = in_lanes(x);
        let mut product = vec![0.0; self.size()];
        Arch::new().dispatch(TransposedMultiply { upper: self, x: &x, product: &mut product });
        product
    }
}

struct Multiply<'a> {
    upper: &'a PackedUpper,
    x: &'a [f64],
    product: &'a mut [[f64; LANES]],
}

impl WithSimd for Multiply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (j, x) in self.x.iter().enumerate() {
            for (y, u) in self.product.iter_mut().zip(self.upper.padded(j)) {
                for l in 0..LANES {
                    y[l] += x * u[l];
                }
            }
        }
    }
}

struct TransposedMultiply<'a> {
    upper: &'a PackedUpper,
    x: &'a [[f64; LANES]],
    product: &'a mut [f64],
}

impl WithSimd for TransposedMultiply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (j, product) in self.product.iter_mut().enumerate() {
            let mut sums = [0.0; LANES];
            for (u, x) in self.upper.padded(j).iter().zip(self.x) {
                for l in 0..LANES {
                    sums[l] += u[l] * x[l];
                }
            }
            let [a, b, c, d, e, f, g, h] = sums;
            *product = ((a + e) + (b + f)) + ((c + g) + (d + h));
        }
    }
}

/// The numbers in whole lanes, filled up with zeros.
fn in_lanes(numbers: &[f64]) -> Vec<[f64; LANES]> {
    let (whole, rest) = numbers.as_chunks::<LANES>();
    let mut lanes = whole.to_vec();
    if !rest.is_empty() {
        let mut last = [0.0; LANES];
        last[..rest.len()].copy_from_slice(rest);
        lanes.push(last);
    }
    lanes
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
