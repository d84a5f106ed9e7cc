//! Normal approximation of the parameters given the data, before the error is known well.

use lacuna::data::Parameter;
use lacuna::math::random::normal;
use lacuna::plugin::Forward;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply, multiply_transposed};

use super::factor::{Estimate, Shifts};
use super::size::Size;
use crate::stage::stream;
use crate::study::Study;

/// Number of points that represent the region of likely parameters.
const POINTS: usize = 64;

/// Normal distribution of the least-squares estimate around its best fit.
pub struct Pilot<'a> {
    pub study: &'a Study,
    pub forward: &'a dyn Forward,
    /// Best fit.
    pub best: &'a [f64],
    /// Derivatives of the outputs at the best fit, per prior standard deviation (`outputs x parameters`).
    pub slopes: &'a Matrix,
}

impl Pilot<'_> {
    /// Root mean square size of the error over the distribution, for an error with this covariance at the selected
    /// outputs.
    ///
    /// The estimate is that of ordinary least squares, whose covariance `G (I + S) G'` is valid whatever its weights:
    /// it does not trust any direction more because of `S`.
    pub fn size(&self, shifts: &Shifts<'_>, even: &Matrix, size: &Size) -> f64 {
        let points = self.points(shifts, even);
        // An emulator that states no variance there gets the size of its curves.
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
            // Keeps the factorisation from failing if the data determine a parameter to round-off.
            let least = if i == j { 1e-12 } else { 0.0 };
            own[(i, j)] + of_error[(i, j)] + least
        });
        let Ok(root) = Cholesky::new(&covariance) else { return points };
        let widths: Vec<f64> = self.study.parameters.iter().map(Parameter::scale).collect();
        let mut rng = stream(self.study, "emulator-error").generator();
        // Rejection of points outside the prior may be frequent at its edges, so the number of tries is limited.
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
            if point.iter().all(|x| x.is_finite()) && self.study.prior().allows(&point) {
                points.push_row(&point);
            }
            if points.rows() == POINTS {
                break;
            }
        }
        points
    }
}

/// Root mean square of the finite values; `None` if none of them is above zero.
fn root_mean_square(values: &[f64]) -> Option<f64> {
    let squares: Vec<f64> = values.iter().filter(|s| s.is_finite()).map(|s| s * s).collect();
    let square = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    (square > 0.0).then(|| square.sqrt())
}
