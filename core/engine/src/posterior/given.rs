//! Log-likelihood from a log density that a study gives in place of measurements.

use lacuna::data::{JointPrior, Parameter};
use lacuna::plugin::density::BoundDensity;
use lacuna::plugin::{Fact, Hyperparameter};
use lacuna_linalg::Matrix;

use super::LogLikelihood;

/// A given log density as a log-likelihood; see the module.
pub struct Given<'a> {
    density: &'a dyn BoundDensity,
    /// Prior that the density already includes; `None` if it includes none.
    included: Option<JointPrior<'a>>,
}

impl<'a> Given<'a> {
    /// A density that is multiplied by the priors.
    pub fn likelihood(density: &'a dyn BoundDensity) -> Self {
        Self { density, included: None }
    }

    /// A density that already includes the prior.
    pub fn posterior(density: &'a dyn BoundDensity, prior: JointPrior<'a>) -> Self {
        Self { density, included: Some(prior) }
    }
}

impl LogLikelihood for Given<'_> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &[]
    }

    fn values(&self, theta: &Matrix, _hyper: &Matrix) -> Vec<f64> {
        let mut values = self.density.log_density(theta);
        let Some(prior) = self.included else { return values };
        for (value, point) in values.iter_mut().zip(theta.iter_rows()) {
            *value -= prior.log_density(point);
        }
        values
    }

    fn value_and_gradient(&self, theta: &[f64], _hyper: &[f64]) -> (f64, Vec<f64>) {
        let (value, mut gradient) = self.density.gradient(theta);
        let Some(prior) = self.included else { return (value, gradient) };
        let mut own: Vec<f64> = prior.parameters().iter().zip(theta).map(slope).collect();
        prior.add_joint_gradient(theta, &mut own);
        gradient.iter_mut().zip(own).for_each(|(slope, own)| *slope -= own);
        (value - prior.log_density(theta), gradient)
    }

    fn facts(&self) -> Vec<Fact> {
        self.density.facts()
    }
}

fn slope((parameter, &x): (&Parameter, &f64)) -> f64 {
    parameter.prior.log_density_derivative(x)
}
