//! Priors, emulator, effects and discrepancy as one log density with its gradient.
//!
//! Coordinates, in this order: the model's parameters in physical units; the parameters of the study's
//! effects; the discrepancy's hyperparameters. A hyperparameter that is declared `log` is represented by
//! its logarithm and the density carries the Jacobian, so that its prior keeps its meaning.

use rayon::prelude::*;

use crate::data::{Layout, Parameter};
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::discrepancy::Compressed;
use crate::plugin::surrogate::Linear;
use crate::plugin::{Effect, Emulator, Hyperparameter, Likelihood, Target};

/// Points that are evaluated together. Fixed, because the rounding of a matrix product depends on the
/// number of its rows and results must not depend on the number of threads.
const BATCH: usize = 30;

/// The posterior of a study.
pub struct Posterior<'a> {
    layout: &'a Layout,
    parameters: &'a [Parameter],
    emulator: &'a dyn Emulator,
    effects: Vec<(&'a dyn Effect, std::ops::Range<usize>)>,
    likelihood: &'a dyn Likelihood,
    reduced: Option<(&'a dyn Linear, Box<dyn Compressed>)>,
    hyper: Vec<Hyperparameter>,
}

impl<'a> Posterior<'a> {
    /// Joins the parts. Without effects and with a linear emulator the likelihood is compressed.
    pub fn new(
        layout: &'a Layout,
        parameters: &'a [Parameter],
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
        Self { layout, parameters, emulator, effects: placed, likelihood, reduced, hyper }
    }

    /// The model's parameters.
    pub fn parameters(&self) -> &[Parameter] {
        self.parameters
    }

    /// The unknowns beside the model's parameters.
    pub fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    /// The coordinates of a point in natural units.
    pub fn natural(&self, point: &[f64]) -> Vec<f64> {
        self.map_logs(point, f64::exp)
    }

    /// The coordinates that represent natural values.
    pub fn coordinates(&self, natural: &[f64]) -> Vec<f64> {
        self.map_logs(natural, f64::ln)
    }

    fn map_logs(&self, point: &[f64], map: impl Fn(f64) -> f64) -> Vec<f64> {
        let d = self.parameters.len();
        let is_log = |i: usize| i >= d && self.hyper[i - d].log;
        point.iter().enumerate().map(|(i, &x)| if is_log(i) { map(x) } else { x }).collect()
    }

    /// The response at a point: the emulator's mean with the effects applied, and the discrepancy's
    /// hyperparameters.
    pub fn response(&self, point: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let natural = self.natural(point);
        let (theta, hyper) = natural.split_at(self.parameters.len());
        let mean = self.emulator.mean(&Matrix::from_vec(1, theta.len(), theta.to_vec()));
        (self.with_effects(mean.row(0).to_vec(), hyper), hyper[self.own()..].to_vec())
    }

    /// The same density over the same coordinates without the Jacobian of the logarithms: its maximum
    /// is the mode of the density in natural units.
    pub fn mode(&'a self) -> Mode<'a> {
        Mode(self)
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

    /// The log prior density of natural values.
    fn log_prior(&self, natural: &[f64]) -> f64 {
        let priors = self.parameters.iter().map(|p| &p.prior);
        let priors = priors.chain(self.hyper.iter().map(|h| &h.prior));
        priors.zip(natural).map(|(prior, &x)| prior.log_density(x)).sum()
    }

    /// The logarithm of the Jacobian of the logarithmic coordinates: their sum.
    fn log_jacobian(&self, point: &[f64]) -> f64 {
        let d = self.parameters.len();
        self.hyper.iter().zip(&point[d..]).filter(|(h, _)| h.log).map(|(_, &x)| x).sum()
    }

    fn batch(&self, points: &Matrix, jacobian: bool) -> Vec<f64> {
        let starts: Vec<usize> = (0..points.rows()).step_by(BATCH).collect();
        let parts: Vec<Vec<f64>> = starts
            .into_par_iter()
            .map(|start| {
                let rows: Vec<usize> = (start..points.rows().min(start + BATCH)).collect();
                self.block(&points.select_rows(&rows), jacobian)
            })
            .collect();
        parts.concat()
    }

    fn block(&self, points: &Matrix, jacobian: bool) -> Vec<f64> {
        let d = self.parameters.len();
        let natural: Vec<Vec<f64>> = points.iter_rows().map(|p| self.natural(p)).collect();
        let mut density: Vec<f64> = natural
            .iter()
            .zip(points.iter_rows())
            .map(|(x, p)| self.log_prior(x) + if jacobian { self.log_jacobian(p) } else { 0.0 })
            .collect();
        let inside: Vec<usize> = (0..points.rows()).filter(|&i| density[i].is_finite()).collect();
        if !inside.is_empty() {
            let theta = Matrix::from_rows(d, inside.iter().map(|&i| &natural[i][..d]));
            let hyper =
                Matrix::from_rows(self.hyper.len(), inside.iter().map(|&i| &natural[i][d..]));
            for (&i, value) in inside.iter().zip(self.log_likelihood(&theta, &hyper)) {
                density[i] += value;
            }
        }
        // A NaN (an overflow far outside the data) is no density at all.
        density.iter().map(|&v| if v.is_nan() { f64::NEG_INFINITY } else { v }).collect()
    }

    fn log_likelihood(&self, theta: &Matrix, hyper: &Matrix) -> Vec<f64> {
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

    /// The log-likelihood's derivatives by the natural coordinates.
    fn likelihood_gradient(&self, natural: &[f64]) -> Vec<f64> {
        let (theta, hyper) = natural.split_at(self.parameters.len());
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
            by_effects[range.clone()].copy_from_slice(&transposed_product(&jacobian, &weight));
            weight = effect.pull_back(self.layout, before, values, &weight);
        }
        let by_theta = transposed_product(&self.emulator.jacobian(theta), &weight);
        [by_theta, by_effects, by_own].concat()
    }

    fn value_and_gradient(&self, point: &[f64], jacobian: bool) -> (f64, Vec<f64>) {
        let d = self.parameters.len();
        let row = Matrix::from_vec(1, point.len(), point.to_vec());
        let value = self.block(&row, jacobian)[0];
        let natural = self.natural(point);
        if !value.is_finite() {
            return (value, vec![0.0; point.len()]);
        }
        let priors = self.parameters.iter().map(|p| &p.prior);
        let priors = priors.chain(self.hyper.iter().map(|h| &h.prior));
        let mut gradient = self.likelihood_gradient(&natural);
        for ((g, prior), &x) in gradient.iter_mut().zip(priors).zip(&natural) {
            *g += prior.log_density_derivative(x);
        }
        for (i, hyper) in self.hyper.iter().enumerate().filter(|(_, h)| h.log) {
            debug_assert!(hyper.log);
            let g = &mut gradient[d + i];
            *g = *g * natural[d + i] + if jacobian { 1.0 } else { 0.0 };
        }
        (value, gradient)
    }

    fn coordinate_bounds(&self) -> Vec<(f64, f64)> {
        let plain = self.parameters.iter().map(|p| p.prior.support());
        let hyper = self.hyper.iter().map(|h| {
            let (low, high) = h.prior.support();
            if h.log { (low.max(0.0).ln(), high.ln()) } else { (low, high) }
        });
        plain.chain(hyper).collect()
    }

    fn draws(&self, count: usize, stream: &Stream) -> Matrix {
        let d = self.parameters.len() + self.hyper.len();
        let priors = || {
            let parameters = self.parameters.iter().map(|p| &p.prior);
            parameters.chain(self.hyper.iter().map(|h| &h.prior))
        };
        let draw = |i: usize| {
            let mut rng = stream.at(i as u64).generator();
            let natural: Vec<f64> = priors().map(|p| p.sample(&mut rng)).collect();
            self.coordinates(&natural)
        };
        Matrix::from_rows(d, (0..count).map(draw))
    }
}

/// `J' w`.
fn transposed_product(jacobian: &Matrix, weight: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; jacobian.columns()];
    for (row, &w) in jacobian.iter_rows().zip(weight) {
        for (sum, &entry) in product.iter_mut().zip(row) {
            *sum += entry * w;
        }
    }
    product
}

impl Target for Posterior<'_> {
    fn dimension(&self) -> usize {
        self.parameters.len() + self.hyper.len()
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        self.batch(points, true)
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        points
            .iter_rows()
            .map(|p| self.log_prior(&self.natural(p)) + self.log_jacobian(p))
            .collect()
    }
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        self.value_and_gradient(point, true)
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.coordinate_bounds()
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        self.draws(count, stream)
    }
}

/// A posterior without the Jacobian of its logarithmic coordinates; see [`Posterior::mode`].
pub struct Mode<'a>(&'a Posterior<'a>);

impl Target for Mode<'_> {
    fn dimension(&self) -> usize {
        self.0.dimension()
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        self.0.batch(points, false)
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|p| self.0.log_prior(&self.0.natural(p))).collect()
    }
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        self.0.value_and_gradient(point, false)
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.0.coordinate_bounds()
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        self.0.draws(count, stream)
    }
}
