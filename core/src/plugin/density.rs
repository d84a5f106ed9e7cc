//! Targets: log densities of a study's parameters without data and without a surrogate.

use super::{Component, Fact};
use crate::data::Parameter;
use crate::linalg::Matrix;
use crate::run::Stop;

/// A log density of a study's parameters that takes the place of simulations, measurements and discrepancy.
///
/// The posterior is the prior times this density, unless [`Density::includes_prior`].
pub trait Density: Component {
    /// The density of these parameters: points have their order and their units.
    fn bind(&self, parameters: &[Parameter]) -> Result<Box<dyn BoundDensity>, Stop>;

    /// Whether this is the whole posterior density already: the prior then serves for starting points and tempering
    /// only, and its support bounds the posterior.
    fn includes_prior(&self) -> bool {
        false
    }
}

/// A log density over points in physical units, up to a constant.
pub trait BoundDensity: Send + Sync {
    /// The log density at each row of `points`: finite, or minus infinity where the density is zero or undefined.
    ///
    /// A value depends on its point alone, to the bit.
    fn log_density(&self, points: &Matrix) -> Vec<f64>;

    /// The log density at a point and its derivative by each coordinate, which are zeros where the density is zero.
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>);

    /// What is worth telling.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }
}
