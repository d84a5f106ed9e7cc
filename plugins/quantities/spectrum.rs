//! Discrete Fourier transform of any length, by Bluestein's algorithm.
//!
//! `k j = (k² + j² - (k - j)²) / 2` turns the transform into a convolution, for which a transform of a power of two is
//! enough (Bluestein, IEEE Trans. Audio Electroacoust. 18 (1970) 451).

use std::f64::consts::PI;

/// Real and imaginary part.
type Complex = (f64, f64);

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

/// Transform of curves of one length.
#[derive(Debug, Clone)]
pub(super) struct Spectrum {
    /// Factors `exp(-i π j² / n)`.
    chirp: Vec<Complex>,
    /// Transform of the conjugate factors.
    kernel: Vec<Complex>,
    /// Factors `exp(-2 π i j / m)` of the transforms of length `m`, a power of two.
    roots: Vec<Complex>,
}

impl Spectrum {
    pub(super) fn new(length: usize) -> Self {
        let turn = |share: f64| ((PI * share).cos(), -(PI * share).sin());
        // The square is reduced first: its own rounding would be amplified.
        let square = |j: usize| ((j as u128 * j as u128) % (2 * length as u128)) as f64;
        let chirp: Vec<Complex> = (0..length).map(|j| turn(square(j) / length as f64)).collect();
        let size = (2 * length).next_power_of_two();
        let roots: Vec<Complex> =
            (0..size / 2).map(|j| turn(2.0 * j as f64 / size as f64)).collect();
        let mut kernel = vec![(0.0, 0.0); size];
        for (j, (re, im)) in chirp.iter().enumerate() {
            kernel[j] = (*re, -im);
            kernel[(size - j) % size] = (*re, -im);
        }
        transform(&mut kernel, &roots);
        Self { chirp, kernel, roots }
    }

    /// Returns the squared magnitudes of the transform of real values, from frequency zero to the highest one.
    pub(super) fn powers(&self, values: &[f64]) -> Vec<f64> {
        let size = self.kernel.len();
        let mut work = vec![(0.0, 0.0); size];
        for ((w, y), (re, im)) in work.iter_mut().zip(values).zip(&self.chirp) {
            *w = (y * re, y * im);
        }
        transform(&mut work, &self.roots);
        // The inverse transform is the conjugate of the transform of the conjugate.
        for (w, k) in work.iter_mut().zip(&self.kernel) {
            let (re, im) = times(*w, *k);
            *w = (re, -im);
        }
        transform(&mut work, &self.roots);
        // The last factor of the algorithm has magnitude one.
        let scale = (size as f64).powi(-2);
        work[..=self.chirp.len() / 2].iter().map(|(re, im)| scale * (re * re + im * im)).collect()
    }
}

/// Transform of a power of two, in place (Cooley and Tukey).
fn transform(values: &mut [Complex], roots: &[Complex]) {
    let size = values.len();
    let bits = size.trailing_zeros();
    for i in 0..size {
        let j = i.reverse_bits() >> (usize::BITS - bits);
        if i < j {
            values.swap(i, j);
        }
    }
    let mut half = 1;
    while half < size {
        let stride = size / (2 * half);
        for block in values.chunks_exact_mut(2 * half) {
            let (first, second) = block.split_at_mut(half);
            for (j, (a, b)) in first.iter_mut().zip(second).enumerate() {
                let turned = times(*b, roots[j * stride]);
                (*a, *b) = ((a.0 + turned.0, a.1 + turned.1), (a.0 - turned.0, a.1 - turned.1));
            }
        }
        half *= 2;
    }
}
