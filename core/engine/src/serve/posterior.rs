//! `posterior`: the log density of all unknowns, in natural units.

use lacuna::math::distribution::Distribution;
use lacuna::plugin::Target;
use lacuna::plugin::model::EvalError;
use lacuna_linalg::Matrix;

use super::{Derivatives, Function, Variable};
use crate::posterior::Posterior;

/// Value where the density is zero. Its logarithm is minus infinity, which JSON cannot represent; every sampler rejects
/// this number just as well.
const NOTHING: f64 = f64::MIN;

/// Log posterior density of natural values: parameters first, then hyperparameters, each with its prior density in its
/// own unit, without a Jacobian.
pub(super) struct LogPosterior<'a>(Posterior<'a>);

impl<'a> LogPosterior<'a> {
    /// Wraps a posterior.
    pub(super) fn of(posterior: Posterior<'a>) -> Self {
        Self(posterior)
    }

    /// Log density at a point.
    fn value(&self, point: &[f64]) -> f64 {
        let allowed = |(prior, &x): (&Distribution, &f64)| prior.log_density(x).is_finite();
        let d = self.0.parameters().len();
        if !self.0.priors().zip(point).all(allowed) || !self.0.prior().allows(&point[..d]) {
            return NOTHING;
        }
        let row = Matrix::from_vec(1, point.len(), self.0.coordinates(point));
        let value = self.0.mode().log_density(&row)[0];
        if value.is_finite() { value } else { NOTHING }
    }
}

impl Function for LogPosterior<'_> {
    fn name(&self) -> &'static str {
        "posterior"
    }

    fn variables(&self) -> Vec<Variable> {
        let parameters = self.0.parameters().iter().map(|p| (&p.name, &p.unit));
        let hyper = self.0.hyperparameters().iter().map(|h| (&h.name, &h.unit));
        let variable = |(name, unit): (&String, &lacuna::data::Unit)| Variable {
            name: name.clone(),
            unit: unit.clone(),
        };
        parameters.chain(hyper).map(variable).collect()
    }

    fn outputs(&self) -> usize {
        1
    }

    fn values(&self, point: &[f64], _: Option<usize>) -> Result<Vec<f64>, EvalError> {
        Ok(vec![self.value(point)])
    }

    fn batch(&self, points: &Matrix) -> Result<Matrix, EvalError> {
        let values: Vec<f64> = points.iter_rows().map(|point| self.value(point)).collect();
        Ok(Matrix::from_vec(points.rows(), 1, values))
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
}

impl Derivatives for LogPosterior<'_> {
    fn jacobian(&self, point: &[f64], _: Option<usize>) -> Result<Matrix, EvalError> {
        if self.value(point) == NOTHING {
            let reason = "the density is zero here, so that its logarithm has no derivatives";
            return Err(EvalError::Rejected(reason.to_owned()));
        }
        let (_, mut gradient) = self.0.mode().gradient(&self.0.coordinates(point));
        let d = self.0.parameters().len();
        for (i, hyper) in self.0.hyperparameters().iter().enumerate().filter(|(_, h)| h.log) {
            debug_assert!(hyper.log);
            // d/dx = d/d(ln x) / x
            gradient[d + i] /= point[d + i];
        }
        Ok(Matrix::from_vec(1, gradient.len(), gradient))
    }

    fn scales(&self) -> Option<Vec<f64>> {
        let widths = self.0.priors().map(|prior| {
            let [low, high] = [0.05, 0.95].map(|share| prior.quantile(share));
            high - low
        });
        Some(widths.collect())
    }
}
