//! A polynomial of one variable, fitted by least squares.

use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, solve_upper, thin_qr, transposed_multiply_vector};

/// Highest degree.
const HIGHEST: usize = 4;

/// Polynomial `sum_k coefficients[k] (t / scale)^k`, of the degree with the smallest leave-one-out error.
pub(super) struct Curve {
    scale: f64,
    coefficients: Vec<f64>,
    /// Sum of the squared leave-one-out residuals.
    pub error: f64,
}

impl Curve {
    /// Fits the polynomial; `None` if `t` does not vary.
    pub fn fit(t: &[f64], values: &[f64]) -> Option<Self> {
        let scale = t.iter().fold(0.0_f64, |most, t| most.max(t.abs()));
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let powers = Matrix::from_fn(t.len(), HIGHEST + 1, |i, k| (t[i] / scale).powi(k as i32));
        let mut best: Option<Self> = None;
        // Two runs to spare beyond the coefficients.
        for degree in (1..=HIGHEST).take_while(|degree| degree + 3 <= t.len().max(4)) {
            let columns: Vec<usize> = (0..=degree).collect();
            let fitted = Self::of(&powers.select_columns(&columns), values, scale);
            if let Some(fitted) = fitted
                && best.as_ref().is_none_or(|b| fitted.error < b.error)
            {
                best = Some(fitted);
            }
        }
        best
    }

    fn of(powers: &Matrix, values: &[f64], scale: f64) -> Option<Self> {
        let qr = thin_qr(powers).ok()?;
        let size = powers.columns();
        let floor = f64::EPSILON * powers.rows() as f64 * qr.r[(0, 0)].abs();
        if powers.rows() <= size || (0..size).any(|k| qr.r[(k, k)].abs() <= floor) {
            return None;
        }
        let projected = transposed_multiply_vector(&qr.q, values);
        let left_out = |(row, y): (&[f64], &f64)| {
            let freedom = (1.0 - dot(row, row)).max(f64::EPSILON);
            ((y - dot(row, &projected)) / freedom).powi(2)
        };
        let error = qr.q.iter_rows().zip(values).map(left_out).sum();
        let mut coefficients = projected;
        solve_upper(&qr.r, &mut coefficients);
        Some(Self { scale, coefficients, error })
    }

    /// Returns the polynomial at `t`.
    pub fn value(&self, t: f64) -> f64 {
        let z = t / self.scale;
        self.coefficients.iter().rev().fold(0.0, |sum, c| sum * z + c)
    }

    /// Returns its derivative at `t`.
    pub fn slope(&self, t: f64) -> f64 {
        let z = t / self.scale;
        let terms = self.coefficients.iter().enumerate().skip(1).rev();
        terms.fold(0.0, |sum, (k, c)| sum * z + k as f64 * c) / self.scale
    }
}
