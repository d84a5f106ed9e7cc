//! Normal distributions in free coordinates.

use lacuna::math::random::normal;
use lacuna::math::special::{HALF_LN_TWO_PI, ln_gamma};
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply_vector, solve_lower};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// A normal distribution with the covariance `L L'`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Law {
    pub mean: Vec<f64>,
    /// Lower triangular factor `L`.
    pub factor: Matrix,
}

impl Law {
    /// Factors the covariance (`d x d`); `None` if it is not positive definite or the mean is not finite.
    pub fn new(mean: Vec<f64>, covariance: &Matrix) -> Option<Self> {
        let cholesky = Cholesky::new(covariance).ok()?;
        let finite = mean.iter().all(|m| m.is_finite());
        finite.then(|| Self { mean, factor: cholesky.lower().clone() })
    }

    /// Returns the distribution with all standard deviations multiplied by `factor`.
    pub fn widened(&self, factor: f64) -> Self {
        let mut law = self.clone();
        for entry in law.factor.as_mut_slice() {
            *entry *= factor;
        }
        law
    }

    /// Returns `mean + L z`.
    pub fn point(&self, z: &[f64]) -> Vec<f64> {
        let offset = multiply_vector(&self.factor, z);
        self.mean.iter().zip(offset).map(|(m, o)| m + o).collect()
    }

    /// Returns the points of all rows of `nodes` (`n x d`).
    pub fn points(&self, nodes: &Matrix) -> Matrix {
        Matrix::from_rows(nodes.columns(), nodes.iter_rows().map(|z| self.point(z)))
    }

    /// Returns `ln det L`.
    pub fn log_volume(&self) -> f64 {
        (0..self.mean.len()).map(|j| self.factor[(j, j)].ln()).sum()
    }

    /// Returns the log density at `point(z)`.
    pub fn log_density_of(&self, z: &[f64]) -> f64 {
        -0.5 * dot(z, z) - z.len() as f64 * HALF_LN_TWO_PI - self.log_volume()
    }

    /// Returns `z` of a point: the solution of `L z = point - mean`.
    pub fn whitened(&self, point: &[f64]) -> Vec<f64> {
        let mut z: Vec<f64> = point.iter().zip(&self.mean).map(|(x, m)| x - m).collect();
        solve_lower(&self.factor, &mut z);
        z
    }

    /// Returns the log density at `point(z)` of Student's t distribution with this centre, factor and number of
    /// degrees of freedom.
    pub fn log_student_density_of(&self, freedom: u32, z: &[f64]) -> f64 {
        let (nu, d) = (f64::from(freedom), z.len() as f64);
        let kernel = -0.5 * (nu + d) * (dot(z, z) / nu).ln_1p();
        let scale = 0.5 * d * (nu * std::f64::consts::PI).ln() + self.log_volume();
        ln_gamma(0.5 * (nu + d)) - ln_gamma(0.5 * nu) + kernel - scale
    }
}

/// Draws the factor that turns a standard normal `z` into a draw of Student's t distribution.
pub(super) fn stretch(freedom: u32, rng: &mut impl Rng) -> f64 {
    let squares: f64 = (0..freedom).map(|_| normal(rng).powi(2)).sum();
    (f64::from(freedom) / squares).sqrt()
}
