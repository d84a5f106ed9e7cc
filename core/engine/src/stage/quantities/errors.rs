//! Draws of the errors of a new replicate, correlated over all outputs.

use lacuna::math::random::Stream;
use lacuna::plugin::Likelihood;
use lacuna::plugin::discrepancy::{CommonError, ErrorPath};
use lacuna::run::Stop;

use crate::stage::calibrate::Law;
use crate::stage::emulator_error;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::Measured;
use crate::study::Study;

/// Errors of a new replicate: those of the discrepancy, and the common errors, which are drawn here for all blocks of
/// scenarios together, because a discrepancy may not know their correlation.
pub(super) struct Errors<'a> {
    likelihood: Option<&'a dyn Likelihood>,
    common: Vec<CommonError>,
}

impl<'a> Errors<'a> {
    /// Errors under the likelihood of predictions.
    pub fn of(
        study: &'a Study,
        measured: &'a Measured,
        problem: &InverseProblem<'a>,
        likelihood: &'a dyn Likelihood,
    ) -> Result<Self, Stop> {
        let law = Law::predicting(study, measured, problem)?;
        let common = law.common().iter().filter(|error| error.predictive).cloned().collect();
        Ok(Self { likelihood: Some(likelihood), common })
    }

    /// Errors of emulator and numerics where nothing was measured, with their mean size over the prior.
    pub fn of_priors(study: &'a Study, problem: &InverseProblem<'a>) -> Result<Self, Stop> {
        let mut common = Vec::new();
        if let Some(fitted) = problem.fitted() {
            common.push(emulator_error::over_prior(study, &fitted.value)?);
        }
        if let (Some(kept), Some(section)) = (problem.numerics(), &study.numerical_error) {
            common.push(kept.value.error_samples(&section.written));
        }
        Ok(Self { likelihood: None, common })
    }

    /// No errors.
    pub fn none() -> Self {
        Self { likelihood: None, common: Vec::new() }
    }

    /// Returns true if there are no errors.
    pub fn is_none(&self) -> bool {
        self.likelihood.is_none() && self.common.is_empty()
    }

    /// Number of errors of emulator and numerics.
    pub fn count(&self) -> usize {
        self.common.len()
    }

    /// One draw of all errors around the response at a point of the posterior.
    pub fn draw(&self, response: &[f64], point: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let of_discrepancy = |likelihood: &dyn Likelihood| {
            let hyper = &point[point.len() - likelihood.hyperparameters().len()..];
            let stream = stream.named("discrepancy");
            likelihood
                .errors_given_data(response, hyper, &stream)
                .unwrap_or_else(|| likelihood.errors(response, hyper, &stream))
        };
        let mut paths = self.likelihood.map(of_discrepancy).unwrap_or_default();
        paths.retain(|path| self.common.iter().all(|error| error.origin != path.origin));
        let stream = stream.named("common");
        let common = self.common.iter().enumerate();
        paths.extend(common.map(|(k, error)| error.draw(&stream.at(k as u64))));
        paths
    }
}
