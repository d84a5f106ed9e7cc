//! The artifacts of the stages up to the validation, together.

use lacuna_run::Kept;

use super::calibrate::Calibrated;
use super::evidence::Weighed;
use super::inverse_problem::InverseProblem;
use super::quantities::Quantified;
use super::read::Measured;
use super::reliability::RareEvents;
use super::validate::Validated;

/// The artifacts of these stages, as far as the study has them.
#[derive(Clone, Copy)]
pub struct Artifacts<'a> {
    /// Runs, measurements and emulator.
    pub problem: Option<&'a InverseProblem<'a>>,
    /// The posterior.
    pub calibrated: Option<&'a Kept<Calibrated>>,
    /// The evidence and the predictive accuracy.
    pub weighed: Option<&'a Kept<Weighed>>,
    /// The calibrated model against the data.
    pub validated: Option<&'a Kept<Validated>>,
    /// The predicted quantities.
    pub quantities: Option<&'a Kept<Quantified>>,
    /// The probabilities of rare events.
    pub reliability: Option<&'a Kept<RareEvents>>,
}

impl<'a> Artifacts<'a> {
    /// The measurements of the study.
    pub fn measured(&self) -> Option<&'a Measured> {
        self.problem.and_then(|problem| problem.data.value.measured.as_ref())
    }
}
