//! Log density as samplers and optimisers see it.

use super::random::Stream;
use crate::matrix::Matrix;

/// A log density to sample from.
///
/// Coordinates are those of the posterior: parameters in physical units, and hyperparameters in logarithms if they are
/// declared so.
pub trait Target: Sync {
    /// Number of coordinates.
    fn dimension(&self) -> usize;

    /// Log density at each row of `points` (`points x dimension`); minus infinity outside the support, never NaN.
    fn log_density(&self, points: &Matrix) -> Vec<f64>;

    /// Log prior density at each row of `points`, in the same coordinates; minus infinity outside its support. The log
    /// density less this is the log-likelihood.
    fn log_prior(&self, points: &Matrix) -> Vec<f64>;

    /// Log density at a point, and its gradient.
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>);

    /// Closed interval of each coordinate; infinite where it is unbounded.
    fn bounds(&self) -> Vec<(f64, f64)>;

    /// Independent draws from the prior, `count x dimension`.
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix;

    /// A cheap density that agrees with this one at `point` in value and gradient, such as that of a model replaced by its
    /// tangent; `None` if there is none, or if the density is zero or undefined there.
    fn linearised(&self, _point: &[f64]) -> Option<Box<dyn Target + '_>> {
        None
    }

    /// Reason why the density can no longer be computed; from then on its values are meaningless. `None` while it
    /// works.
    fn failure(&self) -> Option<String> {
        None
    }
}
