//! Kernels on slices: plain loops in an order that does not depend on the machine, compiled for the widest vector
//! instructions it has. No multiplication is fused with an addition, so the bits are portable.
//!
//! Each kernel is a struct with the loop in `with_simd`: only code inlined there is compiled for the processor at hand,
//! and a closure is not inlined.

#![allow(clippy::inline_always)]

use pulp::{Arch, Simd, WithSimd};

use super::Matrix;

const LANES: usize = 16;

/// Inner product of two slices of equal length.
///
/// # Panics
/// If the lengths differ.
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

/// Sum of the lanes, pairwise.
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

/// Euclidean norm of a vector whose squares neither overflow nor underflow.
pub fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Adds `factor * x` to `y`.
///
/// # Panics
/// If the lengths differ.
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

/// Removes one orthonormal column `q` from a least-squares fit: `residual -= factor * q` and `freedom -= q * q`, entry
/// by entry; returns `sum_i residual_i^2` and `sum_i (residual_i / freedom_i)^2`.
///
/// # Panics
/// If the lengths differ.
pub fn take_out(q: &[f64], factor: f64, residual: &mut [f64], freedom: &mut [f64]) -> [f64; 2] {
    assert_eq!(q.len(), residual.len(), "vectors of one length");
    assert_eq!(q.len(), freedom.len(), "vectors of one length");
    Arch::new().dispatch(TakeOut { q, factor, residual, freedom })
}

struct TakeOut<'a> {
    q: &'a [f64],
    factor: f64,
    residual: &'a mut [f64],
    freedom: &'a mut [f64],
}

impl WithSimd for TakeOut<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [f64; 2] {
        let Self { q, factor, residual, freedom } = self;
        for ((q, r), d) in q.iter().zip(&mut *residual).zip(&mut *freedom) {
            *r -= factor * q;
            *d -= q * q;
        }
        let mut lanes = [[0.0; LANES]; 2];
        let (residual, rest_residual) = residual.as_chunks::<LANES>();
        let (freedom, rest_freedom) = freedom.as_chunks::<LANES>();
        // One statement per loop: in this form the compiler vectorises.
        for (r, d) in residual.iter().zip(freedom) {
            for l in 0..LANES {
                lanes[0][l] += r[l] * r[l];
            }
            for l in 0..LANES {
                let ratio = r[l] / d[l];
                lanes[1][l] += ratio * ratio;
            }
        }
        let mut rest = [0.0; 2];
        for (r, d) in rest_residual.iter().zip(rest_freedom) {
            rest[0] += r * r;
            rest[1] += (r / d) * (r / d);
        }
        [total(&mut lanes[0]) + rest[0], total(&mut lanes[1]) + rest[1]]
    }
}

/// Writes the first entries of the linear combination `sum_i weights[i] * matrix.row(rows[i])` to `out`, as many as it has.
///
/// # Panics
/// If the number of weights differs from that of rows, or `out` is longer than a row.
pub fn combine_rows(matrix: &Matrix, rows: &[usize], weights: &[f64], out: &mut [f64]) {
    combine_rows_of(matrix, rows, [weights], [out]);
}

/// Two linear combinations of the same rows or of their first entries, in little more time than one: reading the rows
/// dominates the cost.
///
/// # Panics
/// If the number of weights differs from that of rows, or an output is longer than a row.
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
        assert!(out[m].len() <= matrix.columns(), "a combination has at most the length of a row");
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
            let (mut residual, mut freedom) = (b.clone(), vec![2.0; n]);
            let [squares, ratios] = take_out(&a, 0.5, &mut residual, &mut freedom);
            let mut plain = [0.0; 2];
            for i in 0..n {
                let (r, d) = (b[i] - 0.5 * a[i], 2.0 - a[i] * a[i]);
                assert_eq!((residual[i], freedom[i]), (r, d));
                plain = [plain[0] + r * r, plain[1] + (r / d).powi(2)];
            }
            assert!((squares - plain[0]).abs() <= 1e-12 * plain[0]);
            assert!((ratios - plain[1]).abs() <= 1e-12 * plain[1]);
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
        let mut beginning = [f64::NAN; 3];
        combine_rows(&m, &rows, &[0.5; 6], &mut beginning);
        assert_eq!(beginning, out[..3]);
    }
}
