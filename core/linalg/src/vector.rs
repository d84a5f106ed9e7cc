//! Kernels on slices: plain loops in an order that does not depend on the machine, compiled for the
//! widest vectors it has. No multiplication is fused with an addition, so the bits are portable.
//!
//! Each kernel is a struct with the loop in `with_simd`: only code inlined there is compiled for
//! the machine at hand, and a closure is not.

#![allow(clippy::inline_always)]

use faer::traits::pulp::{Arch, Simd, WithSimd};

use crate::Matrix;

const LANES: usize = 16;

/// The inner product of two slices of one length.
///
/// # Panics
/// When the lengths differ.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "vectors of one length");
    Arch::new().dispatch(Dot { a, b })
}

struct Dot<'a> {
    a: &'a [f64],
    b: &'a [f64],
}

impl WithSimd for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let mut lanes = [0.0; LANES];
        let (a, rest_a) = self.a.as_chunks::<LANES>();
        let (b, rest_b) = self.b.as_chunks::<LANES>();
        for (x, y) in a.iter().zip(b) {
            for l in 0..LANES {
                lanes[l] += x[l] * y[l];
            }
        }
        let mut rest = 0.0;
        for (x, y) in rest_a.iter().zip(rest_b) {
            rest += x * y;
        }
        total(&mut lanes) + rest
    }
}

/// The sum of the lanes, in pairs.
#[inline(always)]
fn total(lanes: &mut [f64; LANES]) -> f64 {
    let mut width = LANES / 2;
    while width > 0 {
        for l in 0..width {
            lanes[l] += lanes[l + width];
        }
        width /= 2;
    }
    lanes[0]
}

/// The Euclidean length of a vector whose squares neither overflow nor vanish.
pub fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Adds `factor * x` to `y`.
///
/// # Panics
/// When the lengths differ.
pub fn add_scaled(y: &mut [f64], factor: f64, x: &[f64]) {
    assert_eq!(y.len(), x.len(), "vectors of one length");
    Arch::new().dispatch(AddScaled { y, factor, x });
}

struct AddScaled<'a> {
    y: &'a mut [f64],
    factor: f64,
    x: &'a [f64],
}

impl WithSimd for AddScaled<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (y, x) in self.y.iter_mut().zip(self.x) {
            *y += self.factor * x;
        }
    }
}

/// `sum_i (numerators[i] / denominators[i])^2`.
///
/// # Panics
/// When the lengths differ.
pub fn sum_squared_ratios(numerators: &[f64], denominators: &[f64]) -> f64 {
    assert_eq!(numerators.len(), denominators.len(), "vectors of one length");
    Arch::new().dispatch(SumSquaredRatios { numerators, denominators })
}

struct SumSquaredRatios<'a> {
    numerators: &'a [f64],
    denominators: &'a [f64],
}

impl WithSimd for SumSquaredRatios<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let mut lanes = [0.0; LANES];
        let (above, rest_above) = self.numerators.as_chunks::<LANES>();
        let (below, rest_below) = self.denominators.as_chunks::<LANES>();
        for (a, b) in above.iter().zip(below) {
            for l in 0..LANES {
                let ratio = a[l] / b[l];
                lanes[l] += ratio * ratio;
            }
        }
        let mut rest = 0.0;
        for (a, b) in rest_above.iter().zip(rest_below) {
            rest += (a / b) * (a / b);
        }
        total(&mut lanes) + rest
    }
}

/// The combination `sum_i weights[i] * matrix.row(rows[i])`.
///
/// # Panics
/// When there are not as many weights as rows, or `out` is not as long as a row.
pub fn combine_rows(matrix: &Matrix, rows: &[usize], weights: &[f64], out: &mut [f64]) {
    combine_rows_of(matrix, rows, [weights], [out]);
}

/// Two combinations of the same rows, in little more time than one: what takes time is reading them.
///
/// # Panics
/// When there are not as many weights as rows, or the outputs are not as long as a row.
pub fn combine_rows_twice(
    matrix: &Matrix,
    rows: &[usize],
    weights: [&[f64]; 2],
    out: [&mut [f64]; 2],
) {
    combine_rows_of(matrix, rows, weights, out);
}

fn combine_rows_of<const M: usize>(
    matrix: &Matrix,
    rows: &[usize],
    weights: [&[f64]; M],
    out: [&mut [f64]; M],
) {
    for m in 0..M {
        assert_eq!(rows.len(), weights[m].len(), "one weight a row");
        assert_eq!(matrix.columns(), out[m].len(), "a combination has the length of a row");
        out[m].fill(0.0);
    }
    Arch::new().dispatch(CombineRows { matrix, rows, weights, out });
}

struct CombineRows<'a, const M: usize> {
    matrix: &'a Matrix,
    rows: &'a [usize],
    weights: [&'a [f64]; M],
    out: [&'a mut [f64]; M],
}

impl<const M: usize> WithSimd for CombineRows<'_, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (quads, rest) = self.rows.as_chunks::<4>();
        for (q, quad) in quads.iter().enumerate() {
            let [a, b, c, d] = *quad;
            let a = self.matrix.row(a);
            let b = self.matrix.row(b);
            let c = self.matrix.row(c);
            let d = self.matrix.row(d);
            for m in 0..M {
                let w = &self.weights[m][4 * q..4 * q + 4];
                for ((((y, a), b), c), d) in self.out[m].iter_mut().zip(a).zip(b).zip(c).zip(d) {
                    *y += (w[0] * a + w[1] * b) + (w[2] * c + w[3] * d);
                }
            }
        }
        for (i, &row) in rest.iter().enumerate() {
            for m in 0..M {
                let w = self.weights[m][4 * quads.len() + i];
                for (y, x) in self.out[m].iter_mut().zip(self.matrix.row(row)) {
                    *y += w * x;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_agree_with_the_plain_sums() {
        for n in [0_usize, 1, 5, 31, 32, 33, 100] {
            let a: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            let b: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
            let plain: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
            assert!((dot(&a, &b) - plain).abs() < 1e-13);
            let ratios: f64 = a.iter().zip(&b).map(|(x, y)| (x / y).powi(2)).sum();
            assert!((sum_squared_ratios(&a, &b) - ratios).abs() <= 1e-12 * ratios);
            let mut y = b.clone();
            add_scaled(&mut y, 2.0, &a);
            assert!(y.iter().zip(a.iter().zip(&b)).all(|(y, (a, b))| *y == b + 2.0 * a));
        }
    }

    #[test]
    fn rows_are_combined_by_their_weights() {
        let m = Matrix::from_fn(9, 7, |i, j| (i * 7 + j) as f64);
        let rows = [8, 0, 3, 3, 5, 1];
        let weights = [1.0, -2.0, 0.5, 4.0, 0.25, 3.0];
        let mut out = [f64::NAN; 7];
        combine_rows(&m, &rows, &weights, &mut out);
        for (j, y) in out.iter().enumerate() {
            let plain: f64 = rows.iter().zip(weights).map(|(&i, w)| w * m[(i, j)]).sum();
            assert!((y - plain).abs() < 1e-12);
        }
        let (mut first, mut second) = ([0.0; 7], [0.0; 7]);
        combine_rows_twice(&m, &rows, [&[0.5; 6], &weights], [&mut first, &mut second]);
        assert_eq!(second, out);
        combine_rows(&m, &rows, &[0.5; 6], &mut out);
        assert_eq!(first, out);
    }
}
