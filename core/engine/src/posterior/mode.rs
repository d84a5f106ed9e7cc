//! The density whose maximum is the mode in natural units.

use lacuna::math::random::Stream;
use lacuna::plugin::Target;
use lacuna_linalg::Matrix;

use super::Posterior;
use super::linearised::Linearised;

/// A posterior without the Jacobian of its logarithmic coordinates; see [`Posterior::mode`].
pub struct Mode<'a>(pub(super) &'a Posterior<'a>);

impl Target for Mode<'_> {
    fn dimension(&self) -> usize {
        self.0.dimension()
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        self.0.batch(points, false)
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let of = |p: &[f64]| {
            let natural = self.0.natural(p);
            self.0.log_prior(&natural) + self.0.log_jacobian(p, &natural, false)
        };
        points.iter_rows().map(of).collect()
    }
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        self.0.value_and_gradient(point, false)
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.0.coordinate_bounds()
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        self.0.draws(count, stream)
    }
    fn linearised(&self, point: &[f64]) -> Option<Box<dyn Target + '_>> {
        Linearised::of(self.0, point)
    }
}
