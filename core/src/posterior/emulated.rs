//! The likelihood of measurements through an emulator, effects and a discrepancy.

use crate::data::Layout;
use crate::linalg::{Matrix, transposed_multiply_vector};
use crate::plugin::discrepancy::Compressed;
use crate::plugin::surrogate::Linear;
use crate::plugin::{Effect, Emulator, Fact, Hyperparameter, Likelihood};

use super::LogLikelihood;

/// See the module. The hyperparameters are those of the effects, then those of the discrepancy.
pub struct Emulated<'a> {
    layout: &'a Layout,
    emulator: &'a dyn Emulator,
    effects: Vec<(&'a dyn Effect, std::ops::Range<usize>)>,
    likelihood: &'a dyn Likelihood,
    reduced: Option<(&'a dyn Linear, Box<dyn Compressed>)>,
    hyper: Vec<Hyperparameter>,
}

impl<'a> Emulated<'a> {
    /// Joins the parts. Without effects and with a linear emulator the likelihood is compressed.
    pub fn new(
        layout: &'a Layout,
        emulator: &'a dyn Emulator,
        effects: &[&'a dyn Effect],
        likelihood: &'a dyn Likelihood,
    ) -> Self {
        let mut hyper = Vec::new();
        let mut placed = Vec::new();
        for &effect in effects {
            let begin = hyper.len();
            hyper.extend(effect.parameters(layout));
            placed.push((effect, begin..hyper.len()));
        }
        hyper.extend_from_slice(likelihood.hyperparameters());
        let reduced = if effects.is_empty() {
            emulator.linear().and_then(|linear| Some((linear, likelihood.compress(linear)?)))
        } else {
            None
        };
        Self { layout, emulator, effects: placed, likelihood, reduced, hyper }
    }

    /// The response at natural values: the emulator's mean with the effects applied, and the discrepancy's own
    /// hyperparameters.
    pub fn response(&self, theta: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mean = self.emulator.mean(&Matrix::from_vec(1, theta.len(), theta.to_vec()));
        (self.with_effects(mean.row(0).to_vec(), hyper), hyper[self.own()..].to_vec())
    }

    /// Where the discrepancy's own hyperparameters begin.
    fn own(&self) -> usize {
        self.effects.last().map_or(0, |(_, range)| range.end)
    }

    fn with_effects(&self, mut response: Vec<f64>, hyper: &[f64]) -> Vec<f64> {
        for (effect, range) in &self.effects {
            response = effect.apply(self.layout, &response, &hyper[range.clone()]);
        }
        response
    }
}

impl LogLikelihood for Emulated<'_> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn values(&self, theta: &Matrix, hyper: &Matrix) -> Vec<f64> {
        if let Some((linear, compressed)) = &self.reduced {
            return compressed.log_likelihood_at(*linear, theta, hyper);
        }
        let mean = self.emulator.mean(theta);
        let own = self.own();
        mean.iter_rows()
            .zip(hyper.iter_rows())
            .map(|(mean, hyper)| {
                let response = self.with_effects(mean.to_vec(), hyper);
                self.likelihood.log_likelihood(&response, &hyper[own..])
            })
            .collect()
    }

    fn gradient(&self, theta: &[f64], hyper: &[f64]) -> Vec<f64> {
        if let Some((linear, compressed)) = &self.reduced {
            let (by_theta, by_hyper) = compressed.gradient_at(*linear, theta, hyper);
            return [by_theta, by_hyper].concat();
        }
        let row = Matrix::from_vec(1, theta.len(), theta.to_vec());
        let mut responses = vec![self.emulator.mean(&row).row(0).to_vec()];
        for (effect, range) in &self.effects {
            let before = &responses[responses.len() - 1];
            responses.push(effect.apply(self.layout, before, &hyper[range.clone()]));
        }
        let last = &responses[responses.len() - 1];
        let (mut weight, by_own) = self.likelihood.gradient(last, &hyper[self.own()..]);
        let mut by_effects = vec![0.0; self.own()];
        for ((effect, range), before) in self.effects.iter().zip(&responses).rev() {
            let values = &hyper[range.clone()];
            let jacobian = effect.by_parameters(self.layout, before, values);
            by_effects[range.clone()]
                .copy_from_slice(&transposed_multiply_vector(&jacobian, &weight));
            weight = effect.pull_back(self.layout, before, values, &weight);
        }
        let by_theta = transposed_multiply_vector(&self.emulator.jacobian(theta), &weight);
        [by_theta, by_effects, by_own].concat()
    }

    fn facts(&self) -> Vec<Fact> {
        self.likelihood.facts()
    }
}
