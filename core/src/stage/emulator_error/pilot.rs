//! A normal law of the parameters given the data, before the error is known well.

use crate::linalg::vector::dot;
use crate::linalg::{Cholesky, Matrix, multiply, multiply_transposed};
use crate::math::random::normal;
use crate::plugin::Forward;
use crate::stage::{best_fit, stream};
use crate::study::Study;

use super::factor::{Estimate, Shifts};
use super::size::Size;

/// So many points stand for where the parameters may be.
const POINTS: usize = 64;

/// The normal law of the least-squares estimate about its best fit.
pub struct Pilot<'a> {
    pub study: &'a Study,
    pub forward: &'a dyn Forward,
    /// The best fit.
    pub best: &'a [f64],
    /// The derivatives of the outputs there, by parameter in widths of the prior.
    pub slopes: &'a Matrix,
}

impl Pilot<'_> {
    /// The root mean square size of the error over the law, for an error of this covariance at the chosen outputs.
    ///
    /// The estimate is that of ordinary least squares, whose covariance `G (I + S) G'` holds whatever its weights: it trusts no
    /// direction more for what `S` says.
    pub fn size(&self, shifts: &Shifts<'_>, even: &Matrix, size: &Size) -> f64 {
        let points = self.points(shifts, even);
        // An emulator that states no variance there has the size of its curves.
        let values = size.values(self.forward, &points).unwrap_or_else(|| size.at_curves.clone());
        root_mean_square(&values).or_else(|| root_mean_square(&size.at_curves)).unwrap_or(1.0)
    }

    /// Points inside the prior's support, the best fit first.
    fn points(&self, shifts: &Shifts<'_>, even: &Matrix) -> Matrix {
        let slopes = shifts.slopes(self.slopes);
        let mut points = Matrix::from_rows(self.best.len(), [self.best]);
        let Some(estimate) = Estimate::of(&vec![0.0; even.rows()], 1.0, &slopes) else {
            return points;
        };
        let gain = &estimate.gain;
        let own = multiply_transposed(gain, gain);
        let of_error = multiply_transposed(&multiply(gain, even), gain);
        let covariance = Matrix::from_fn(own.rows(), own.columns(), |i, j| {
            let least = if i == j { 1e-12 } else { 0.0 };
            own[(i, j)] + of_error[(i, j)] + least
        });
        let Ok(root) = Cholesky::new(&covariance) else { return points };
        let widths: Vec<f64> =
            self.study.parameters.iter().map(|p| best_fit::scale(&p.prior)).collect();
        let mut rng = stream(self.study, "emulator-error").generator();
        for _ in 0..20 * POINTS {
            let white: Vec<f64> = self.best.iter().map(|_| normal(&mut rng)).collect();
            let moved = (0..white.len()).map(|k| dot(&root.lower().row(k)[..=k], &white[..=k]));
            let point: Vec<f64> = self
                .best
                .iter()
                .zip(moved)
                .zip(&widths)
                .zip(&self.study.parameters)
                .map(|(((best, moved), width), p)| {
                    let x = best + moved * width;
                    if p.prior.log_density(x).is_finite() { x } else { f64::NAN }
                })
                .collect();
            if point.iter().all(|x| x.is_finite()) {
                points.push_row(&point);
            }
            if points.rows() == POINTS {
                break;
            }
        }
        points
    }
}

/// Of the finite values; `None` where none of them is above zero.
fn root_mean_square(values: &[f64]) -> Option<f64> {
    let squares: Vec<f64> = values.iter().filter(|s| s.is_finite()).map(|s| s * s).collect();
    let square = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    (square > 0.0).then(|| square.sqrt())
}
