//! The likelihood of measurements through a forward map, effects and a discrepancy.

use std::ops::Range;

use crate::linalg::vector::dot;
use crate::linalg::{Matrix, transposed_multiply_vector};
use crate::plugin::discrepancy::Compressed;
use crate::plugin::effect::Placed;
use crate::plugin::forward::Linear;
use crate::plugin::{Fact, Forward, Hyperparameter, Likelihood};

use super::LogLikelihood;

/// See the module. The hyperparameters are those of the effects, then those of the discrepancy.
pub struct OfData<'a> {
    forward: &'a dyn Forward,
    effects: Vec<(Placed<'a>, Range<usize>)>,
    likelihood: &'a dyn Likelihood,
    reduced: Option<(&'a dyn Linear, Box<dyn Compressed>)>,
    hyper: Vec<Hyperparameter>,
}

impl<'a> OfData<'a> {
    /// Joins the parts. Without effects and with a linear forward map the likelihood is compressed.
    pub fn new(
        forward: &'a dyn Forward,
        effects: Vec<Placed<'a>>,
        likelihood: &'a dyn Likelihood,
    ) -> Self {
        let mut hyper = Vec::new();
        let mut placed = Vec::new();
        for effect in effects {
            let begin = hyper.len();
            hyper.extend(effect.hyperparameters());
            placed.push((effect, begin..hyper.len()));
        }
        hyper.extend_from_slice(likelihood.hyperparameters());
        let reduced = if placed.is_empty() {
            forward.linear().and_then(|linear| Some((linear, likelihood.compress(linear)?)))
        } else {
            None
        };
        Self { forward, effects: placed, likelihood, reduced, hyper }
    }

    /// The response at natural values: that of the forward map with the effects applied, and the discrepancy's
    /// own hyperparameters.
    pub fn response(&self, theta: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mean = self.forward.mean(&Matrix::from_vec(1, theta.len(), theta.to_vec()));
        (self.with_effects(mean.row(0).to_vec(), hyper), hyper[self.own()..].to_vec())
    }

    /// Where the discrepancy's own hyperparameters begin.
    fn own(&self) -> usize {
        self.effects.last().map_or(0, |(_, range)| range.end)
    }

    fn with_effects(&self, mut response: Vec<f64>, hyper: &[f64]) -> Vec<f64> {
        for (effect, range) in &self.effects {
            response = effect.apply(&response, &hyper[range.clone()]);
        }
        response
    }

    /// The response, and its derivatives by the parameters and then by the effects' unknowns, one a row.
    fn tangents(&self, theta: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let row = Matrix::from_vec(1, theta.len(), theta.to_vec());
        let mut response = self.forward.mean(&row).row(0).to_vec();
        let slopes = self.forward.jacobian(theta);
        let mut tangents: Vec<Vec<f64>> = (0..theta.len()).map(|j| slopes.column(j)).collect();
        for (effect, range) in &self.effects {
            let values = &hyper[range.clone()];
            for tangent in &mut tangents {
                *tangent = effect.push_forward(&response, values, tangent);
            }
            let own = effect.by_parameters(&response, values);
            tangents.extend((0..values.len()).map(|j| own.column(j)));
            response = effect.apply(&response, values);
        }
        (response, tangents)
    }

    fn gradient_without_effects(&self, theta: &[f64], hyper: &[f64]) -> Vec<f64> {
        let row = Matrix::from_vec(1, theta.len(), theta.to_vec());
        let mean = self.forward.mean(&row);
        if mean.row(0).iter().any(|y| !y.is_finite()) {
            return vec![0.0; theta.len() + hyper.len()];
        }
        let (weight, by_own) = self.likelihood.gradient(mean.row(0), hyper);
        let by_theta = transposed_multiply_vector(&self.forward.jacobian(theta), &weight);
        [by_theta, by_own].concat()
    }
}

impl LogLikelihood for OfData<'_> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn values(&self, theta: &Matrix, hyper: &Matrix) -> Vec<f64> {
        if let Some((linear, compressed)) = &self.reduced {
            return compressed.log_likelihood_at(*linear, theta, hyper);
        }
        let mean = self.forward.mean(theta);
        let own = self.own();
        mean.iter_rows()
            .zip(hyper.iter_rows())
            .map(|(mean, hyper)| {
                if mean.iter().any(|y| !y.is_finite()) {
                    return f64::NEG_INFINITY;
                }
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
        if self.effects.is_empty() {
            return self.gradient_without_effects(theta, hyper);
        }
        let (response, tangents) = self.tangents(theta, hyper);
        if response.iter().any(|y| !y.is_finite()) {
            return vec![0.0; theta.len() + hyper.len()];
        }
        let (weight, by_own) = self.likelihood.gradient(&response, &hyper[self.own()..]);
        let mut all: Vec<f64> = tangents.iter().map(|tangent| dot(tangent, &weight)).collect();
        all.extend(by_own);
        all
    }

    fn facts(&self) -> Vec<Fact> {
        self.likelihood.facts()
    }

    fn failure(&self) -> Option<String> {
        self.forward.failure()
    }
}
