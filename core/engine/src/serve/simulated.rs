//! `model`: the study's simulator.

use lacuna::plugin::model::{EvalError, Gradient};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::{Derivatives, Function, Part, Variable, parameters, parts};
use crate::stage::simulator::{Setting, Simulator};
use crate::study::Study;

/// The simulator as a function of the study's parameters.
pub(super) struct Simulated<'a> {
    study: &'a Study,
    simulator: Simulator<'a>,
    gradient: Option<&'a dyn Gradient>,
    parts: Vec<Part>,
}

impl<'a> Simulated<'a> {
    /// The simulator of a study; `None` if it has no model.
    pub(super) fn of(study: &'a Study) -> Result<Option<Self>, Stop> {
        let (Some(simulator), Some(section)) = (Simulator::of(study)?, &study.model) else {
            return Ok(None);
        };
        let gradient = section.built.plugin.gradient();
        Ok(Some(Self { study, simulator, gradient, parts: parts(study) }))
    }

    /// Settings of all scenarios, or of one.
    fn settings(&self, scenario: Option<usize>) -> &[Setting<'a>] {
        let all = &self.simulator.settings[..];
        scenario.map_or(all, |i| &all[i..=i])
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

    fn scenarios(&self) -> &[Part] {
        &self.parts
    }

    fn values(&self, point: &[f64], scenario: Option<usize>) -> Result<Vec<f64>, EvalError> {
        let settings = self.settings(scenario);
        self.simulator.in_range(settings, point)?;
        if scenario.is_some() {
            return self.simulator.respond_to(&settings[0], point).map(|response| response.values);
        }
        self.simulator.respond(point).map(|response| response.values)
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        self.gradient.map(|_| self as &dyn Derivatives)
    }
}

impl Derivatives for Simulated<'_> {
    fn jacobian(&self, point: &[f64], scenario: Option<usize>) -> Result<Matrix, EvalError> {
        let settings = self.settings(scenario);
        self.simulator.in_range(settings, point)?;
        let gradient = self
            .gradient
            .ok_or_else(|| EvalError::Fatal("the model has no derivatives".to_owned()))?;
        if scenario.is_some() {
            return self.simulator.jacobian(&settings[0], gradient, point);
        }
        let mut all = Matrix::zeros(self.outputs(), point.len());
        for setting in settings {
            let part = self.simulator.jacobian(setting, gradient, point)?;
            for (k, row) in setting.outputs.clone().enumerate() {
                all.row_mut(row).copy_from_slice(part.row(k));
            }
        }
        Ok(all)
    }

    fn scales(&self) -> Option<Vec<f64>> {
        // A simulator's derivatives may be as rough as its mesh, so they are not differenced.
        None
    }
}
