//! Kernels for functions of the distance between points. No multiplication is fused with an addition, so the bits are
//! portable, and those of a point do not depend on its neighbours.

#![allow(clippy::inline_always)]

use pulp::{Arch, Simd, WithSimd};

use crate::Matrix;
use crate::lanes::LANES;

/// Squared distances of a point from the first `out.len()` columns of `points` (`dimension x count`).
///
/// # Panics
/// If the dimensions differ or there are fewer points than `out` is long.
pub fn squared_distances(point: &[f64], points: &Matrix, out: &mut [f64]) {
    assert_eq!(point.len(), points.rows(), "points of one dimension");
    assert!(out.len() <= points.columns(), "as many points as distances");
    Arch::new().dispatch(SquaredDistances { point, points, out });
}

struct SquaredDistances<'a> {
    point: &'a [f64],
    points: &'a Matrix,
    out: &'a mut [f64],
}

impl WithSimd for SquaredDistances<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.out.fill(0.0);
        for (k, &x) in self.point.iter().enumerate() {
            for (sum, y) in self.out.iter_mut().zip(self.points.row(k)) {
                let difference = x - y;
                *sum += difference * difference;
            }
        }
    }
}

/// Replaces each number `x` by `sum_n coefficients[n] x^n`, by Horner's rule.
pub fn polynomials(x: &mut [f64], coefficients: &[f64]) {
    Arch::new().dispatch(Polynomials { x, coefficients });
}

struct Polynomials<'a> {
    x: &'a mut [f64],
    coefficients: &'a [f64],
}

impl WithSimd for Polynomials<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (chunks, rest) = self.x.as_chunks_mut::<LANES>();
        for x in chunks {
            let mut sums = [0.0; LANES];
            for c in self.coefficients.iter().rev() {
                for l in 0..LANES {
                    sums[l] = sums[l] * x[l] + c;
                }
            }
            *x = sums;
        }
        for x in rest {
            *x = self.coefficients.iter().rev().fold(0.0, |sum, c| sum * *x + c);
        }
    }
}

/// Smallest and largest argument of [`exponentials`] whose result is a normal number.
const RANGE: (f64, f64) = (-708.0, 709.0);
/// `ln 2` in two parts; the first ends in zero bits, so that its integer multiples are exact.
const LN_2: (f64, f64) = (6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10);
/// `1.5 * 2^52`: the sum with a small number holds the nearest integer in its last bits.
const SHIFT: f64 = 6_755_399_441_055_744.0;

/// Replaces each number by its exponential, accurate to two units of round-off; arguments are clamped to -708..709.
pub fn exponentials(x: &mut [f64]) {
    Arch::new().dispatch(Exponentials { x });
}

struct Exponentials<'a> {
    x: &'a mut [f64],
}

impl WithSimd for Exponentials<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for x in self.x {
            *x = exponential(*x);
        }
    }
}

/// `2^n e^r` with `x = n ln 2 + r` and the series of `e^r` up to `r^13`.
#[inline(always)]
fn exponential(x: f64) -> f64 {
    const COEFFICIENTS: [f64; 12] = [
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
    ];
    let above = if x < RANGE.0 { RANGE.0 } else { x };
    let x = if above > RANGE.1 { RANGE.1 } else { above };
    // Adding and subtracting `SHIFT` rounds to the nearest integer without a branch or a call, so that the loop
    // vectorises.
    let shifted = x * std::f64::consts::LOG2_E + SHIFT;
    let n = shifted - SHIFT;
    let r = (x - n * LN_2.0) - n * LN_2.1;
    let mut sum = 1.0 / 6_227_020_800.0;
    for c in COEFFICIENTS {
        sum = sum * r + c;
    }
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    power * (sum * r + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_agree_with_the_library() {
        let arguments: Vec<f64> = (0..200_000).map(|i| -708.0 + 7.07e-3 * f64::from(i)).collect();
        let mut found = arguments.clone();
        exponentials(&mut found);
        for (x, y) in arguments.iter().zip(&found) {
            assert!((y - x.exp()).abs() <= 2.0 * f64::EPSILON * x.exp(), "{x}: {y}");
        }
        let mut special = [0.0, -1e300, 1e300];
        exponentials(&mut special);
        assert_eq!(special[0], 1.0);
        assert!(special[1] > 0.0 && special[1] < 1e-306 && special[2].is_finite());
    }

    #[test]
    fn polynomials_are_those_of_horner() {
        let mut x: Vec<f64> = (0..37).map(|i| 0.1 * f64::from(i)).collect();
        let plain: Vec<f64> = x.iter().map(|x| 2.0 - x + 0.5 * x.powi(3)).collect();
        polynomials(&mut x, &[2.0, -1.0, 0.0, 0.5]);
        assert!(x.iter().zip(plain).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn squared_distances_are_sums_of_squares() {
        let points = Matrix::from_fn(3, 21, |k, j| ((7 * k + j) as f64).sin());
        let point = [0.3, -0.8, 2.0];
        let mut out = [f64::NAN; 20];
        squared_distances(&point, &points, &mut out);
        for (j, found) in out.iter().enumerate() {
            let plain: f64 = (0..3).map(|k| (point[k] - points[(k, j)]).powi(2)).sum();
            assert!((found - plain).abs() < 1e-14);
        }
    }
}
