//! Upper triangular matrices that grow by columns.
#![allow(clippy::inline_always)]

use pulp::{Arch, Simd, WithSimd};

const LANES: usize = 8;

/// An upper triangular `n x n` matrix to which columns are appended, as factors that are updated one column at a time.
///
/// Stored in panels of eight columns, each column after the other, without the zeros below the panel.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PackedUpper {
    /// Panels; columns that do not exist yet are zero.
    lanes: Vec<[f64; LANES]>,
    size: usize,
}

/// Index of the first entry of panel `p`: the panels before it have `1, 2, ..., p` lanes per column.
fn start(p: usize) -> usize {
    LANES * p * (p + 1) / 2
}

impl PackedUpper {
    /// A matrix without columns.
    pub fn new() -> Self {
        Self::default()
    }

    /// Size `n` of the matrix.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Column `j` down to the diagonal: `j + 1` entries.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn column(&self, j: usize) -> &[f64] {
        assert!(j < self.size, "a column of the matrix");
        let panel = j / LANES;
        let first = start(panel) + j % LANES * (panel + 1);
        &self.lanes[first..=first + panel].as_flattened()[..=j]
    }

    /// Appends a column, given down to the diagonal.
    ///
    /// # Panics
    /// If it does not have `n + 1` entries.
    pub fn push(&mut self, column: &[f64]) {
        assert_eq!(column.len(), self.size + 1, "a column reaches down to the diagonal");
        let panel = self.size / LANES;
        self.lanes.resize(start(panel + 1), [0.0; LANES]);
        let first = start(panel) + self.size % LANES * (panel + 1);
        self.lanes[first..=first + panel].as_flattened_mut()[..column.len()]
            .copy_from_slice(column);
        self.size += 1;
    }

    /// Removes all but the first `count` columns.
    pub fn truncate(&mut self, count: usize) {
        self.size = self.size.min(count);
        let panels = self.size.div_ceil(LANES);
        self.lanes.truncate(start(panels));
        // The panel in which the matrix ends may hold columns that are removed.
        let last = self.size / LANES;
        let end = start(last) + self.size % LANES * (last + 1);
        if let Some(removed) = self.lanes.get_mut(end..) {
            removed.fill([0.0; LANES]);
        }
    }

    /// Writes `U U' x` to `product` and returns `|U' x|^2`, reading the matrix once. `x` is padded with zeros during
    /// the call.
    ///
    /// # Panics
    /// If `x` does not have `n` entries.
    pub fn square_multiply(&self, x: &mut Vec<f64>, product: &mut Vec<f64>) -> f64 {
        assert_eq!(x.len(), self.size, "a vector of the matrix' size");
        let padded = self.size.next_multiple_of(LANES);
        x.resize(padded, 0.0);
        product.clear();
        product.resize(padded, 0.0);
        let (x_lanes, product_lanes) = (x.as_chunks().0, product.as_chunks_mut().0);
        let squares = Arch::new().dispatch(SquareMultiply {
            upper: &self.lanes,
            x: x_lanes,
            product: product_lanes,
        });
        x.truncate(self.size);
        product.truncate(self.size);
        squares
    }
}

struct SquareMultiply<'a> {
    upper: &'a [[f64; LANES]],
    x: &'a [[f64; LANES]],
    product: &'a mut [[f64; LANES]],
}

impl WithSimd for SquareMultiply<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let mut squares = 0.0;
        for p in 0..self.x.len() {
            let length = p + 1;
            let panel = &self.upper[start(p)..start(p + 1)];
            let (left, right) = panel.split_at(4 * length);
            let x = &self.x[..length];
            let product = &mut self.product[..length];
            // Four columns at a time: their inner products stay in registers until the same columns are combined, so
            // that the matrix is read once.
            for columns in [left, right] {
                let weights = inner_products(columns, x);
                combine(columns, weights, product);
                let [a, b, c, d] = weights;
                squares += (a * a + b * b) + (c * c + d * d);
            }
        }
        squares
    }
}

/// Inner products of four consecutive columns with a vector.
#[inline(always)]
fn inner_products(columns: &[[f64; LANES]], x: &[[f64; LANES]]) -> [f64; 4] {
    let ((a, b), (c, d)) = halves(columns);
    [inner_product(a, x), inner_product(b, x), inner_product(c, x), inner_product(d, x)]
}

#[inline(always)]
fn inner_product(column: &[[f64; LANES]], x: &[[f64; LANES]]) -> f64 {
    let mut sums = [0.0; LANES];
    for (u, x) in column.iter().zip(x) {
        for l in 0..LANES {
            sums[l] += u[l] * x[l];
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    // A fixed tree of additions: the bits do not depend on the width of the processor's vectors.
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}

/// Adds four columns times their weights to `product`.
#[inline(always)]
fn combine(columns: &[[f64; LANES]], weights: [f64; 4], product: &mut [[f64; LANES]]) {
    let ((a, b), (c, d)) = halves(columns);
    let left = a.as_flattened().iter().zip(b.as_flattened());
    let right = c.as_flattened().iter().zip(d.as_flattened());
    for ((y, (a, b)), (c, d)) in product.as_flattened_mut().iter_mut().zip(left).zip(right) {
        *y += (weights[0] * a + weights[1] * b) + (weights[2] * c + weights[3] * d);
    }
}

type Column<'a> = &'a [[f64; LANES]];

#[inline(always)]
fn halves(columns: Column<'_>) -> ((Column<'_>, Column<'_>), (Column<'_>, Column<'_>)) {
    let length = columns.len() / 4;
    let (left, right) = columns.split_at(2 * length);
    (left.split_at(length), right.split_at(length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_agree_with_their_definition() {
        let entry = |i: usize, j: usize| ((3 * i + 7 * j) as f64).sin();
        let mut upper = PackedUpper::new();
        for n in 0..46 {
            let mut x: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
            let transposed: Vec<f64> =
                (0..n).map(|j| (0..=j).map(|i| entry(i, j) * x[i]).sum()).collect();
            let mut product = vec![f64::NAN; 3];
            let squares = upper.square_multiply(&mut x, &mut product);
            assert_eq!((x.len(), product.len(), upper.size()), (n, n, n));
            for (i, y) in product.iter().enumerate() {
                let plain: f64 = (i..n).map(|j| entry(i, j) * transposed[j]).sum();
                assert!((y - plain).abs() < 1e-11, "{n} {i}");
            }
            let plain: f64 = transposed.iter().map(|z| z * z).sum();
            assert!((squares - plain).abs() < 1e-11);
            upper.push(&(0..=n).map(|i| entry(i, n)).collect::<Vec<_>>());
            assert!(
                (0..=n).all(|j| upper.column(j).iter().enumerate().all(|(i, u)| *u == entry(i, j)))
            );
        }
    }
    #[test]
    fn a_truncated_matrix_is_one_that_never_had_the_columns() {
        let column = |n: usize| (0..=n).map(|i| ((3 * i + 7 * n) as f64).sin()).collect::<Vec<_>>();
        for (size, count) in [(21, 0), (21, 8), (21, 11), (24, 16), (24, 23), (5, 9)] {
            let [mut long, mut short] = [size, count.min(size)].map(|size| {
                let mut upper = PackedUpper::new();
                (0..size).for_each(|n| upper.push(&column(n)));
                upper
            });
            long.truncate(count);
            assert_eq!(long, short, "{count} of {size}");
            let next = column(count.min(size));
            long.push(&next);
            short.push(&next);
            assert_eq!(long, short);
        }
    }
}
