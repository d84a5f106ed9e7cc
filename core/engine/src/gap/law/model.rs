//! The study's model with further inputs, evaluated with values of these inputs that differ between conditions.

use lacuna::plugin::model::EvalError;
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use crate::gap::experiment::Experiment;
use crate::gap::inside::Pieces;
use crate::stage::simulator::{Setting, Simulator};
use crate::study::Study;

/// The response with its derivatives.
pub(super) struct Answer {
    /// The response, one value an output, in its unit.
    pub response: Vec<f64>,
    /// The derivatives by the study's parameters, `parameters x outputs`.
    pub by_parameters: Matrix,
    /// The derivatives by the inputs of the pieces, `inputs x outputs`: at each output by the inputs of its condition.
    pub by_inputs: Matrix,
}

/// The model with all pieces.
pub(super) struct Widened<'a> {
    pub simulator: Simulator<'a>,
    parameters: usize,
    inputs: usize,
    outputs: usize,
}

impl<'a> Widened<'a> {
    /// The model of a study with all of these pieces; `None` if it cannot be made.
    pub fn new(study: &'a Study, pieces: &'a Pieces) -> Option<Self> {
        let simulator = pieces.simulator(study, pieces.whole()).ok()?;
        let (parameters, outputs) = (study.parameters.len(), study.layouts.len());
        Some(Self { simulator, parameters, inputs: pieces.inputs.len(), outputs })
    }

    /// The number of conditions.
    pub fn conditions(&self) -> usize {
        self.simulator.settings.len()
    }

    /// The response with its derivatives at values of the study's parameters and, for each condition, of the inputs, under
    /// these conditions alone; `None` if the model has no answer there.
    pub fn answer(
        &self,
        parameters: &[f64],
        inputs: &[Vec<f64>],
        conditions: &[usize],
    ) -> Option<Answer> {
        let gradient = self.simulator.model.gradient()?;
        let of = |&c: &usize| {
            let (setting, point) = (&self.simulator.settings[c], [parameters, &inputs[c]].concat());
            self.simulator.with_derivatives(setting, gradient, &point)
        };
        let settings: Vec<&Setting<'a>> =
            conditions.iter().map(|&c| &self.simulator.settings[c]).collect();
        let each: Result<Vec<_>, EvalError> = conditions.par_iter().map(of).collect();
        let mut all = Answer {
            response: vec![0.0; self.outputs],
            by_parameters: Matrix::zeros(self.parameters, self.outputs),
            by_inputs: Matrix::zeros(self.inputs, self.outputs),
        };
        for (setting, (response, jacobian)) in settings.into_iter().zip(each.ok()?) {
            for (k, i) in setting.outputs.clone().enumerate() {
                all.response[i] = response.values[k];
                for j in 0..self.parameters {
                    all.by_parameters[(j, i)] = jacobian[(k, j)];
                }
                for j in 0..self.inputs {
                    all.by_inputs[(j, i)] = jacobian[(k, self.parameters + j)];
                }
            }
        }
        let is_finite = |matrix: &Matrix| matrix.as_slice().iter().all(|x| x.is_finite());
        (is_finite(&all.by_parameters) && is_finite(&all.by_inputs)).then_some(all)
    }

    /// The conditions of which an experiment has measurements.
    pub fn measured(&self, experiment: &Experiment<'_>) -> Vec<usize> {
        let settings = &self.simulator.settings;
        let has = |c: &usize| {
            let own = experiment.conditions.iter().filter(|k| k.outputs == settings[*c].outputs);
            own.into_iter().any(|k| !k.replicates.is_empty())
        };
        (0..settings.len()).filter(has).collect()
    }

    /// The response alone, under these conditions.
    pub fn response(
        &self,
        parameters: &[f64],
        inputs: &[Vec<f64>],
        conditions: &[usize],
    ) -> Option<Vec<f64>> {
        let mut all = vec![0.0; self.outputs];
        for &c in conditions {
            let (setting, point) = (&self.simulator.settings[c], [parameters, &inputs[c]].concat());
            let response = self.simulator.respond_to(setting, &point).ok()?;
            all[setting.outputs.clone()].copy_from_slice(&response.values);
        }
        Some(all)
    }

    /// The values of expressions along the run of one condition; `None` if the model has no answer there.
    pub fn along(
        &self,
        condition: usize,
        parameters: &[f64],
        inputs: &[Vec<f64>],
        expressions: &[String],
    ) -> Option<Vec<Vec<f64>>> {
        if expressions.is_empty() {
            return Some(Vec::new());
        }
        let setting = &self.simulator.settings[condition];
        let values = setting.inputs(&[parameters, &inputs[condition][..]].concat());
        let amend = self.simulator.model.amend()?;
        amend.along(&self.simulator.call(setting, &values), expressions).ok()
    }

    /// The times of one condition, in the unit of the model's axis.
    pub fn times(&self, condition: usize) -> &[f64] {
        let asked = &self.simulator.settings[condition].asked;
        asked.abscissa().map_or(&[], |(_, at, _)| at)
    }
}
