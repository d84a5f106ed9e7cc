//! `model`: the study's simulator.

use super::{Derivatives, Function, Variable, parameters};
use crate::linalg::{Matrix, multiply};
use crate::plugin::model::{Call, EvalError, Gradient};
use crate::run::Stop;
use crate::stage::simulator::Simulator;
use crate::study::Study;

/// The simulator as a function of the study's parameters.
pub(super) struct Simulated<'a> {
    study: &'a Study,
    simulator: Simulator<'a>,
    /// The range of each input of the model.
    ranges: Vec<(f64, f64)>,
    /// The derivative of each input of the model (rows) by each parameter (columns): a change of units.
    by_parameters: Matrix,
    /// From the model's unit of the response to the study's.
    factor: f64,
    gradient: Option<&'a dyn Gradient>,
}

impl<'a> Simulated<'a> {
    /// The simulator of a study, if it has a model.
    pub(super) fn of(study: &'a Study) -> Result<Option<Self>, Stop> {
        let (Some(simulator), Some(section)) = (Simulator::of(study)?, &study.model) else {
            return Ok(None);
        };
        let model = &*section.built.plugin;
        let signature = model.signature(&study.context());
        let ranges = signature.inputs.iter().map(|input| input.range).collect();
        let d = study.parameters.len();
        let origin = simulator.inputs(&vec![0.0; d]);
        let columns = (0..d).map(|j| {
            let unit: Vec<f64> = (0..d).map(|i| if i == j { 1.0 } else { 0.0 }).collect();
            let moved = simulator.inputs(&unit);
            moved.iter().zip(&origin).map(|(a, b)| a - b).collect::<Vec<f64>>()
        });
        let by_parameters = Matrix::from_rows(origin.len(), columns).transposed();
        let factor = signature.layout.unit.factor_to(&study.layout.unit).unwrap_or(f64::NAN);
        let gradient = model.gradient();
        Ok(Some(Self { study, simulator, ranges, by_parameters, factor, gradient }))
    }

    /// The model's inputs, if it answers there.
    fn inputs(&self, point: &[f64]) -> Result<Vec<f64>, EvalError> {
        let inputs = self.simulator.inputs(point);
        for ((x, (low, high)), name) in inputs.iter().zip(&self.ranges).zip(&self.simulator.names) {
            if !(low..=high).contains(&x) {
                return Err(EvalError::Rejected(format!(
                    "`{name}` is {x} in the model's unit, outside {low} to {high} where it answers"
                )));
            }
        }
        Ok(inputs)
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
        self.study.layout.len()
    }

    fn values(&self, point: &[f64]) -> Result<Vec<f64>, EvalError> {
        self.inputs(point)?;
        self.simulator.respond(point).map(|response| response.values)
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        self.gradient.map(|_| self as &dyn Derivatives)
    }
}

impl Derivatives for Simulated<'_> {
    fn jacobian(&self, point: &[f64]) -> Result<Matrix, EvalError> {
        let inputs = self.inputs(point)?;
        let gradient = self
            .gradient
            .ok_or_else(|| EvalError::Fatal("the model knows no derivatives".to_owned()))?;
        let jacobian = gradient.jacobian(&Call {
            inputs: &inputs,
            names: &self.simulator.names,
            layout: &self.simulator.asked,
            scenario: &self.simulator.scenario,
            study: &self.study.directory,
            directory: None,
        })?;
        let mut product = multiply(&jacobian, &self.by_parameters);
        product.as_mut_slice().iter_mut().for_each(|value| *value *= self.factor);
        Ok(product)
    }

    fn scales(&self) -> Option<Vec<f64>> {
        // A simulator's derivatives may be as rough as its mesh.
        None
    }
}
