//! The model with which a search begins.

use lacuna::data::Parameter;
use lacuna::plugin::Forward;
use lacuna::plugin::discrepancy::CommonError;

use crate::gap::inside::InsideCandidates;
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

/// A model with which a search begins: the study's, or another in its place.
#[derive(Clone, Copy)]
pub struct SearchModel<'a> {
    /// The forward map: from parameters to responses.
    pub forward: &'a dyn Forward,
    /// The parameters.
    pub parameters: &'a [Parameter],
    /// The bounds within which the forward map is valid, if they are narrower than the priors.
    pub region: Option<&'a [(f64, f64)]>,
    /// The candidates inside it.
    pub inside: &'a InsideCandidates<'a>,
    /// The covariance of the emulator's error of another model than the study's.
    pub other: Option<&'a [CommonError]>,
    /// The types of the candidates, if only some are tried.
    pub only: Option<&'a [String]>,
}

impl<'a> SearchModel<'a> {
    /// The study's model.
    pub fn own(
        study: &'a Study,
        problem: &InverseProblem<'a>,
        inside: &'a InsideCandidates<'a>,
    ) -> Self {
        let (forward, region) = (problem.forward(), problem.region());
        let parameters = &study.parameters[..];
        Self { forward, parameters, region, inside, other: None, only: None }
    }
}
