//! `replicate`: the study's response with its effects, and new replicates around it.

use lacuna::math::random::Stream;
use lacuna::plugin::model::EvalError;
use lacuna::plugin::{Forward, Likelihood};
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::{Function, Variable};
use crate::stage::calibrate::Parts;
use crate::stage::predict;
use crate::study::Study;

/// Response as a function of all unknowns, and what a new replicate would measure there.
pub(super) struct Replicated<'a> {
    study: &'a Study,
    forward: &'a dyn Forward,
    /// Likelihood whose errors are those of a new replicate.
    law: Parts,
    variables: Vec<Variable>,
}

impl<'a> Replicated<'a> {
    /// The response of a study and its replicates; `variables` are all unknowns of the posterior.
    pub(super) fn new(
        study: &'a Study,
        forward: &'a dyn Forward,
        law: Parts,
        variables: Vec<Variable>,
    ) -> Self {
        Self { study, forward, law, variables }
    }

    fn responses(&self, points: &Matrix) -> Result<Vec<Vec<f64>>, EvalError> {
        let responses = predict::responses(self.study, self.forward, points);
        match self.forward.failure() {
            Some(reason) => Err(EvalError::Fatal(reason)),
            None => Ok(responses),
        }
    }
}

impl Function for Replicated<'_> {
    fn name(&self) -> &'static str {
        "replicate"
    }

    fn variables(&self) -> Vec<Variable> {
        self.variables.clone()
    }

    fn outputs(&self) -> usize {
        self.forward.outputs()
    }

    fn values(&self, point: &[f64], _: Option<usize>) -> Result<Vec<f64>, EvalError> {
        let row = Matrix::from_vec(1, point.len(), point.to_vec());
        Ok(self.responses(&row)?.swap_remove(0))
    }

    fn batch(&self, points: &Matrix) -> Result<Matrix, EvalError> {
        Ok(Matrix::from_rows(self.outputs(), self.responses(points)?))
    }

    fn is_local(&self) -> bool {
        true
    }

    fn replicates(&self, points: &Matrix, seed: u64) -> Result<Option<Matrix>, EvalError> {
        let likelihood: &dyn Likelihood = self.law.likelihood();
        let own = likelihood.hyperparameters().len();
        let random = Stream::root(seed).named("replicate");
        let one = |(i, mut response): (usize, Vec<f64>)| {
            let point = points.row(i);
            let hyper = &point[point.len() - own..];
            for path in likelihood.errors(&response, hyper, &random.at(i as u64)) {
                response.iter_mut().zip(path.values).for_each(|(y, error)| *y += error);
            }
            response
        };
        let responses = self.responses(points)?;
        let rows: Vec<Vec<f64>> = responses.into_par_iter().enumerate().map(one).collect();
        Ok(Some(Matrix::from_rows(self.outputs(), rows)))
    }
}
