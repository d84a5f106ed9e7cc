//! `model`: the study's simulator.

use super::{Derivatives, Function, Variable, parameters};
use crate::linalg::Matrix;
use crate::plugin::model::{EvalError, Gradient};
use crate::run::Stop;
use crate::stage::simulator::Simulator;
use crate::study::Study;

/// The simulator as a function of the study's parameters.
pub(super) struct Simulated<'a> {
    study: &'a Study,
    simulator: Simulator<'a>,
    gradient: Option<&'a dyn Gradient>,
}

impl<'a> Simulated<'a> {
    /// The simulator of a study, if it has a model.
    pub(super) fn of(study: &'a Study) -> Result<Option<Self>, Stop> {
        let (Some(simulator), Some(section)) = (Simulator::of(study)?, &study.model) else {
            return Ok(None);
        };
        let gradient = section.built.plugin.gradient();
        Ok(Some(Self { study, simulator, gradient }))
    }
}

impl Function for Simulated<'_> {
    fn name(&self) -> &'static str {
        "model"
    }

    fn variables(&self) -> Vec<Variable> {
        parameters(self.study)
    }

    fn outputs(&self) -> usize {
        self.study.layouts.len()
    }

    fn values(&self, point: &[f64]) -> Result<Vec<f64>, EvalError> {
        self.simulator.in_range(point)?;
        self.simulator.respond(point).map(|response| response.values)
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        self.gradient.map(|_| self as &dyn Derivatives)
    }
}

impl Derivatives for Simulated<'_> {
    fn jacobian(&self, point: &[f64]) -> Result<Matrix, EvalError> {
        self.simulator.in_range(point)?;
        let gradient = self
            .gradient
            .ok_or_else(|| EvalError::Fatal("the model knows no derivatives".to_owned()))?;
        let mut all = Matrix::zeros(self.outputs(), point.len());
        for setting in &self.simulator.settings {
            let part = self.simulator.jacobian(setting, gradient, point)?;
            for (k, row) in setting.outputs.clone().enumerate() {
                all.row_mut(row).copy_from_slice(part.row(k));
            }
        }
        Ok(all)
    }

    fn scales(&self) -> Option<Vec<f64>> {
        // A simulator's derivatives may be as rough as its mesh.
        None
    }
}
