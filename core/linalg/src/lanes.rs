//! Values of several points side by side, so that a loop over terms computes all of them at once, whatever the terms.
//! No multiplication is fused with an addition, so the bits are portable and those of a point do not depend on its
//! neighbours.

#![allow(clippy::inline_always)]

use pulp::{Arch, Simd, WithSimd};

/// Number of points side by side.
pub const LANES: usize = 16;

/// One value per point.
pub type Lanes = [f64; LANES];

/// Sparse matrix times a table: `out[r] = sum_k weights[k] table[columns[k]]` for `k` in `starts[r]..starts[r + 1]`.
///
/// # Panics
/// If the numbers of columns and weights differ, `starts` does not fit `out`, or a column is not in the table.
pub fn sparse_multiply(
    starts: &[usize],
    columns: &[u16],
    weights: &[f64],
    table: &[Lanes],
    out: &mut [Lanes],
) {
    sums(starts, columns, weights, table, out);
}

/// Sparse sums of products with a table: `out[r] = sum_k factors[k] table[columns[k]]` for `k` in
/// `starts[r]..starts[r + 1]`, each point with its own factors.
///
/// # Panics
/// If the numbers of columns and factors differ, `starts` does not fit `out`, or a column is not in the table.
pub fn sparse_products(
    starts: &[usize],
    columns: &[u16],
    factors: &[Lanes],
    table: &[Lanes],
    out: &mut [Lanes],
) {
    sums(starts, columns, factors, table, out);
}

/// Factor of a row of the table: one number, or one of each point.
trait Factor {
    fn at(&self, lane: usize) -> f64;
}

impl Factor for f64 {
    #[inline(always)]
    fn at(&self, _: usize) -> f64 {
        *self
    }
}

impl Factor for Lanes {
    #[inline(always)]
    fn at(&self, lane: usize) -> f64 {
        self[lane]
    }
}

fn sums<F: Factor>(
    starts: &[usize],
    columns: &[u16],
    factors: &[F],
    table: &[Lanes],
    out: &mut [Lanes],
) {
    assert_eq!(columns.len(), factors.len(), "one column a factor");
    assert_eq!(starts.len(), out.len() + 1, "one row an output");
    Arch::new().dispatch(SparseSums { starts, columns, factors, table, out });
}

struct SparseSums<'a, F> {
    starts: &'a [usize],
    columns: &'a [u16],
    factors: &'a [F],
    table: &'a [Lanes],
    out: &'a mut [Lanes],
}

impl<F: Factor> WithSimd for SparseSums<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (out, bounds) in self.out.iter_mut().zip(self.starts.windows(2)) {
            let range = bounds[0]..bounds[1];
            let mut sums = [0.0; LANES];
            for (factor, &column) in self.factors[range.clone()].iter().zip(&self.columns[range]) {
                let values = &self.table[usize::from(column)];
                for l in 0..LANES {
                    sums[l] += factor.at(l) * values[l];
                }
            }
            *out = sums;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sparse_product_agrees_with_its_definition() {
        let table: Vec<Lanes> =
            (0..5).map(|c| std::array::from_fn(|l| (3 * c + l) as f64)).collect();
        let (starts, columns) = ([0, 2, 2, 5], [4, 1, 0, 2, 3]);
        let weights = [2.0, -1.0, 0.5, 3.0, 1.0];
        let mut out = [[f64::NAN; LANES]; 3];
        sparse_multiply(&starts, &columns, &weights, &table, &mut out);
        for l in 0..LANES {
            let entry = |c: usize| table[c][l];
            assert_eq!(out[0][l], 2.0 * entry(4) - entry(1));
            assert_eq!(out[1][l], 0.0);
            assert_eq!(out[2][l], 0.5 * entry(0) + 3.0 * entry(2) + entry(3));
        }
        let factors = [4, 0, 2, 2, 1].map(|c: usize| table[c]);
        sparse_products(&starts, &columns, &factors, &table, &mut out);
        for l in 0..LANES {
            let entry = |c: usize| table[c][l];
            assert_eq!(out[0][l], entry(4) * entry(4) + entry(0) * entry(1));
            assert_eq!(out[1][l], 0.0);
            assert_eq!(out[2][l], entry(2) * entry(0) + entry(2) * entry(2) + entry(1) * entry(3));
        }
    }
}
