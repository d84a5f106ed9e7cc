//! Kernels on slices: plain loops in an order that does not depend on the machine, compiled for the
//! widest vectors it has. No multiplication is fused with an addition, so the bits are portable.

use faer::traits::pulp::Arch;

use crate::Matrix;

const LANES: usize = 16;

/// The inner product of two slices of one length.
///
/// # Panics
/// When the lengths differ.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "vectors of one length");
    Arch::new().dispatch(
        #[inline(always)]
        || dot_inline(a, b),
    )
}

// Only code inlined into a dispatched closure is compiled for the machine's widest vectors.
#[expect(clippy::inline_always)]
#[inline(always)]
pub(crate) fn dot_inline(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let (head_a, tail_a) = a.as_chunks::<LANES>();
    let (head_b, tail_b) = b.as_chunks::<LANES>();
    for (x, y) in head_a.iter().zip(head_b) {
        for l in 0..LANES {
            lanes[l] += x[l] * y[l];
        }
    }
    let tail = tail_a.iter().zip(tail_b).fold(0.0, |sum, (x, y)| sum + x * y);
    let mut width = LANES / 2;
    while width > 0 {
        for l in 0..width {
            lanes[l] += lanes[l + width];
        }
        width /= 2;
    }
    lanes[0] + tail
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
    Arch::new().dispatch(
        #[inline(always)]
        || add_scaled_inline(y, factor, x),
    );
}

#[expect(clippy::inline_always)]
#[inline(always)]
pub(crate) fn add_scaled_inline(y: &mut [f64], factor: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

/// The combination `sum_i weights[i] * matrix.row(rows[i])`, of its first `out.len()` entries.
///
/// # Panics
/// When there are not as many weights as rows, or `out` is longer than a row.
pub fn combine_rows(matrix: &Matrix, rows: &[usize], weights: &[f64], out: &mut [f64]) {
    assert_eq!(rows.len(), weights.len(), "one weight a row");
    let length = out.len();
    out.fill(0.0);
    Arch::new().dispatch(
        #[inline(always)]
        || {
            let (quads, rest) = rows.as_chunks::<4>();
            let (quad_weights, rest_weights) = weights.as_chunks::<4>();
            for (rows, w) in quads.iter().zip(quad_weights) {
                let [a, b, c, d] = rows.map(|row| &matrix.row(row)[..length]);
                for ((((y, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                    *y += (w[0] * a + w[1] * b) + (w[2] * c + w[3] * d);
                }
            }
            for (&row, w) in rest.iter().zip(rest_weights) {
                for (y, x) in out.iter_mut().zip(&matrix.row(row)[..length]) {
                    *y += w * x;
                }
            }
        },
    );
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
        let mut out = [f64::NAN; 5];
        combine_rows(&m, &rows, &weights, &mut out);
        for (j, y) in out.iter().enumerate() {
            let plain: f64 = rows.iter().zip(weights).map(|(&i, w)| w * m[(i, j)]).sum();
            assert!((y - plain).abs() < 1e-12);
        }
    }
}
