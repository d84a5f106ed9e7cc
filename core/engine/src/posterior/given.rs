//! Log-likelihood from a log density that a study gives in place of measurements.

use lacuna::data::Parameter;
use lacuna::plugin::density::BoundDensity;
use lacuna::plugin::{Fact, Hyperparameter};
use lacuna_linalg::Matrix;

use super::LogLikelihood;

/// A given log density as a log-likelihood; see the module.
pub struct Given<'a> {
    density: &'a dyn BoundDensity,
    /// Parameters whose priors the density already includes; empty if it includes none.
    included: &'a [Parameter],
}

impl<'a> Given<'a> {
    /// A density that is multiplied by the priors.
    pub fn likelihood(density: &'a dyn BoundDensity) -> Self {
        Self { density, included: &[] }
    }

    /// A density that already includes the priors of these parameters.
    pub fn posterior(density: &'a dyn BoundDensity, parameters: &'a [Parameter]) -> Self {
        Self { density, included: parameters }
    }
}

impl LogLikelihood for Given<'_> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &[]
    }

    fn values(&self, theta: &Matrix, _hyper: &Matrix) -> Vec<f64> {
        let mut values = self.density.log_density(theta);
        for (value, point) in values.iter_mut().zip(theta.iter_rows()) {
            let priors = self.included.iter().zip(point);
            *value -= priors.map(|(p, &x)| p.prior.log_density(x)).sum::<f64>();
        }
        values
    }

    fn value_and_gradient(&self, theta: &[f64], _hyper: &[f64]) -> (f64, Vec<f64>) {
        let (value, mut gradient) = self.density.gradient(theta);
        let priors = self.included.iter().zip(theta);
        for (slope, (p, &x)) in gradient.iter_mut().zip(priors.clone()) {
            *slope -= p.prior.log_density_derivative(x);
        }
        (value - priors.map(|(p, &x)| p.prior.log_density(x)).sum::<f64>(), gradient)
    }

    fn facts(&self) -> Vec<Fact> {
        self.density.facts()
    }
}
