//! Targets: log densities of a study's parameters without data and without a surrogate.

use lacuna_base::data::Parameter;
use lacuna_base::matrix::Matrix;
use lacuna_base::run::Stop;

use super::{Component, Fact};

/// A log density of a study's parameters that takes the place of simulations, measurements and discrepancy.
///
/// The posterior is the prior times this density, unless [`Density::includes_prior`].
pub trait Density: Component {
    /// The density of these parameters; points have their order and their units.
    fn bind(&self, parameters: &[Parameter]) -> Result<Box<dyn BoundDensity>, Stop>;

    /// Returns true if this is already the whole posterior density: the prior then serves only for starting points and
    /// tempering, and its support bounds the posterior.
    fn includes_prior(&self) -> bool {
        false
    }
}

/// A log density of points in physical units, up to a constant.
pub trait BoundDensity: Send + Sync {
    /// Log density at each row of `points` (`points x parameters`): finite, or minus infinity where the density is zero
    /// or undefined.
    ///
    /// Each value depends on its point alone, to the last bit.
    fn log_density(&self, points: &Matrix) -> Vec<f64>;

    /// Log density at a point and its derivative by each coordinate; the derivatives are zero where the density is
    /// zero.
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>);

    /// Facts for the report.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }
}
