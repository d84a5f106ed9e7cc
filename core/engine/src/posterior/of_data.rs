//! Likelihood of measurements for a forward map, effects and a discrepancy.

use std::ops::Range;

use lacuna::data::Population;
use lacuna::plugin::discrepancy::Compressed;
use lacuna::plugin::effect::{Placed, with_tangents};
use lacuna::plugin::forward::{Linear, Numbers};
use lacuna::plugin::{Fact, Forward, Hyperparameter, Likelihood};
use lacuna_linalg::{Matrix, multiply_vector};
use rayon::prelude::*;

use super::LogLikelihood;

/// Number of values requested from the forward map at once.
const BATCH: usize = 1 << 20;

/// Likelihood of measurements; see the module. The hyperparameters are those of the effects, then those of the
/// discrepancy.
pub struct OfData<'a> {
    forward: &'a dyn Forward,
    effects: Vec<(Placed<'a>, Range<usize>)>,
    likelihood: &'a dyn Likelihood,
    reduced: Option<(&'a dyn Linear, Box<dyn Compressed>)>,
    hyper: Vec<Hyperparameter>,
    populations: Vec<Population>,
}

impl<'a> OfData<'a> {
    /// Combines the parts. Without effects and with a linear forward map the likelihood is compressed.
    pub fn new(
        forward: &'a dyn Forward,
        effects: Vec<Placed<'a>>,
        likelihood: &'a dyn Likelihood,
    ) -> Self {
        let mut all = Self::uncompressed(forward, effects, likelihood);
        if all.effects.is_empty() {
            let compress = |linear| Some((linear, likelihood.compress(linear)?));
            all.reduced = forward.linear().and_then(compress);
        }
        all
    }

    /// Combines the parts without compression, which takes longer than a few evaluations.
    pub fn uncompressed(
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
        let populations = Vec::new();
        Self { forward, effects: placed, likelihood, reduced: None, hyper, populations }
    }

    /// The same likelihood where some of its unknowns are members of populations, found by `find` among all of them.
    #[must_use]
    pub fn pooled(mut self, find: impl FnOnce(&mut [Hyperparameter]) -> Vec<Population>) -> Self {
        self.populations = find(&mut self.hyper);
        self
    }

    /// Response at natural values: that of the forward map with the effects applied; and the discrepancy's own
    /// hyperparameters.
    pub fn response(&self, theta: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mean = self.forward.mean(&Matrix::from_vec(1, theta.len(), theta.to_vec()));
        (self.with_effects(mean.row(0).to_vec(), theta, hyper), hyper[self.own()..].to_vec())
    }

    /// Index at which the discrepancy's own hyperparameters begin.
    fn own(&self) -> usize {
        self.effects.last().map_or(0, |(_, range)| range.end)
    }

    /// Log-likelihood for each row of responses of the forward map (`points x outputs`); rows that are not finite are
    /// skipped.
    fn batch(&self, means: Matrix, theta: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let mut values = vec![f64::NEG_INFINITY; means.rows()];
        let finite = |&i: &usize| means.row(i).iter().all(|y| y.is_finite());
        let asked: Vec<usize> = (0..means.rows()).filter(finite).collect();
        let own: Vec<usize> = (self.own()..hyper.columns()).collect();
        let own = hyper.select_rows(&asked).select_columns(&own);
        let responses = match (self.effects.is_empty(), asked.len() == means.rows()) {
            (true, true) => means,
            (true, false) => means.select_rows(&asked),
            (false, _) => {
                let with = |&i: &usize| {
                    self.with_effects(means.row(i).to_vec(), theta.row(i), hyper.row(i))
                };
                Matrix::from_rows(means.columns(), asked.iter().map(with))
            }
        };
        for (&i, value) in asked.iter().zip(self.likelihood.log_likelihoods(&responses, &own)) {
            values[i] = value;
        }
        values
    }

    /// Logarithm of the estimated likelihood at one point from its runs, the given rows of `runs`.
    fn estimate(&self, runs: &Matrix, rows: Range<usize>, theta: &[f64], hyper: &[f64]) -> f64 {
        let is_finite = |row: &[f64]| row.iter().all(|y| y.is_finite());
        let response = |i: usize| {
            let row = runs.row(i);
            if is_finite(row) {
                self.with_effects(row.to_vec(), theta, hyper)
            } else {
                row.to_vec()
            }
        };
        let responses = Matrix::from_rows(runs.columns(), rows.map(response));
        if !responses.iter_rows().any(is_finite) {
            return f64::NEG_INFINITY;
        }
        self.likelihood.log_estimate(&responses, &hyper[self.own()..])
    }

    /// Log-likelihood and its derivatives, given the response of the forward map and its Jacobian (`outputs x parameters`).
    fn value_and_gradient_of(
        &self,
        mean: Vec<f64>,
        jacobian: &Matrix,
        theta: &[f64],
        hyper: &[f64],
    ) -> (f64, Vec<f64>) {
        let effects = self.effects.iter().map(|(effect, range)| (effect, &hyper[range.clone()]));
        let (response, tangents) = with_tangents(effects, mean, jacobian, theta);
        if response.iter().any(|y| !y.is_finite()) {
            return (f64::NEG_INFINITY, vec![0.0; theta.len() + hyper.len()]);
        }
        let own = &hyper[self.own()..];
        let value = self.likelihood.log_likelihood(&response, own);
        let (weight, by_own) = self.likelihood.gradient(&response, own);
        (value, [multiply_vector(&tangents, &weight), by_own].concat())
    }

    fn with_effects(&self, mut response: Vec<f64>, theta: &[f64], hyper: &[f64]) -> Vec<f64> {
        for (effect, range) in &self.effects {
            response = effect.apply(&response, &hyper[range.clone()], theta);
        }
        response
    }
}

impl<'a> LogLikelihood for OfData<'a> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn populations(&self) -> &[Population] {
        &self.populations
    }

    fn values(&self, theta: &Matrix, hyper: &Matrix) -> Vec<f64> {
        if let Some((linear, compressed)) = &self.reduced {
            return compressed.log_likelihood_at(*linear, theta, hyper);
        }
        // Long records are evaluated in batches, because many at once would fill the memory.
        let rows: Vec<usize> = (0..theta.rows()).collect();
        let batches = rows.chunks((BATCH / self.forward.outputs().max(1)).max(1));
        let batch = |rows: &[usize]| {
            let theta = theta.select_rows(rows);
            self.batch(self.forward.mean(&theta), &theta, &hyper.select_rows(rows))
        };
        batches.flat_map(batch).collect()
    }

    fn runs(&self) -> Option<usize> {
        self.forward.is_stochastic().then(|| self.likelihood.runs().max(1))
    }

    fn estimates(&self, theta: &Matrix, hyper: &Matrix, numbers: Numbers) -> Vec<f64> {
        let Some(count) = self.runs() else { return self.values(theta, hyper) };
        let rows: Vec<usize> = (0..theta.rows()).collect();
        let batches = rows.chunks((BATCH / (count * self.forward.outputs()).max(1)).max(1));
        let batch = |points: &[usize]| {
            let runs = self.forward.runs(&theta.select_rows(points), count, numbers);
            let one = |(k, &i): (usize, &usize)| {
                self.estimate(&runs, count * k..count * (k + 1), theta.row(i), hyper.row(i))
            };
            points.par_iter().enumerate().map(one).collect::<Vec<f64>>()
        };
        batches.flat_map(batch).collect()
    }

    fn value_and_gradient(&self, theta: &[f64], hyper: &[f64]) -> (f64, Vec<f64>) {
        if let Some((linear, compressed)) = &self.reduced {
            let row = |values: &[f64]| Matrix::from_vec(1, values.len(), values.to_vec());
            let value = compressed.log_likelihood_at(*linear, &row(theta), &row(hyper))[0];
            let (by_theta, by_hyper) = compressed.gradient_at(*linear, theta, hyper);
            return (value, [by_theta, by_hyper].concat());
        }
        let (mean, jacobian) = self.forward.mean_and_jacobian(theta);
        self.value_and_gradient_of(mean, &jacobian, theta, hyper)
    }

    /// The likelihood of the model's tangent, where its own is a cheap function of the response.
    fn linearised(&self, theta: &[f64]) -> Option<Box<dyn LogLikelihood + '_>> {
        if self.reduced.is_some() || self.forward.is_stochastic() || !self.likelihood.is_cheap() {
            return None;
        }
        let (mean, jacobian) = self.forward.mean_and_jacobian(theta);
        let is_finite = mean.iter().chain(jacobian.as_slice()).all(|y| y.is_finite());
        is_finite.then(|| {
            Box::new(Tangent { of: self, theta: theta.to_vec(), mean, jacobian })
                as Box<dyn LogLikelihood>
        })
    }

    fn facts(&self) -> Vec<Fact> {
        self.likelihood.facts()
    }

    fn failure(&self) -> Option<String> {
        let of_effect = |(effect, _): &(Placed<'a>, Range<usize>)| {
            effect.effect.faults().iter().find_map(|fault| fault.said().map(str::to_owned))
        };
        let own = self.forward.failure().or_else(|| self.likelihood.failure());
        own.or_else(|| self.effects.iter().find_map(of_effect))
    }
}

/// A likelihood whose forward map is replaced by its tangent at a point.
struct Tangent<'a> {
    of: &'a OfData<'a>,
    theta: Vec<f64>,
    mean: Vec<f64>,
    /// Derivatives there, `outputs x parameters`.
    jacobian: Matrix,
}

impl Tangent<'_> {
    fn mean(&self, theta: &[f64]) -> Vec<f64> {
        let moved: Vec<f64> = theta.iter().zip(&self.theta).map(|(x, from)| x - from).collect();
        let change = multiply_vector(&self.jacobian, &moved);
        self.mean.iter().zip(change).map(|(mean, change)| mean + change).collect()
    }
}

impl LogLikelihood for Tangent<'_> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.of.hyper
    }

    fn values(&self, theta: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let means = theta.iter_rows().map(|theta| self.mean(theta));
        self.of.batch(Matrix::from_rows(self.mean.len(), means), theta, hyper)
    }

    fn value_and_gradient(&self, theta: &[f64], hyper: &[f64]) -> (f64, Vec<f64>) {
        self.of.value_and_gradient_of(self.mean(theta), &self.jacobian, theta, hyper)
    }

    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }
}
