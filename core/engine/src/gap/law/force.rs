//! The force over time: a Gauss-Markov process in the rate of a state.
//!
//! The force is a sum of cosines over the duration of the response, the eigenfunctions of processes that are free at both
//! ends. The variances of their weights fall with the frequency as the spectral density of a Gauss-Markov process of
//! first or second order (Matérn processes of smoothness 1/2 and 3/2; Hartikainen and Särkkä, MLSP 2010), whose size and
//! correlation time have the largest marginal likelihood. Response and unknowns are linearised about the last trajectory
//! (Gauss and Newton's method; Tarantola, Inverse Problem Theory, 2005, section 3.2).

use std::f64::consts::PI;

use lacuna::math::distribution::Distribution;
use lacuna::plugin::amend::Addition;
use lacuna::plugin::effect::Description;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, multiply_transposed, multiply_vector};

use super::model::{Answer, Widened};
use super::posterior::{Linear, Posterior, Pull, with_widths};
use super::quantity::quantity;
use super::sites::Site;
use crate::gap::experiment::Experiment;
use crate::gap::experiment::wider::FreeInput;
use crate::gap::inside::Piece;
use crate::gap::noise::{Noise, ResponseTangents};
use crate::gap::system::coordinate::log_slope;
use crate::gap::system::fit::precision;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::Projection;

/// The largest number of cosines under one condition, and under all conditions together.
const COSINES: usize = 64;
const ALL: usize = 256;

/// The smallest number of cosines.
const FEWEST: usize = 6;

/// Steps of Gauss and Newton's method.
const STEPS: usize = 5;

/// Halvings of a step that does not improve the fit.
const HALVINGS: usize = 6;

/// The relative gain of the penalised misfit at which the steps end.
const GAIN: f64 = 1e-4;

/// The correlation times that are tried, by the number of cosines below which the density is flat.
const CORNERS: [f64; 7] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// The data and the model for which a force is inferred.
pub(super) struct ForceSetting<'a, 'b> {
    pub experiment: &'b Experiment<'a>,
    pub model: &'b Widened<'b>,
    /// The number of cosines, which are the first inputs of the model.
    pub cosines: usize,
    /// The root mean square of the rate.
    pub size: f64,
}

/// A force that was inferred.
#[derive(Clone)]
pub(super) struct Inferred {
    /// The study's parameters and the weights of the cosines under each condition.
    pub parameters: Vec<f64>,
    pub weights: Vec<Vec<f64>>,
    /// The response with the force.
    pub response: Vec<f64>,
    /// The whitener of the noise around it.
    pub whitener: Whitener,
    /// The log Bayes factor against no force.
    pub log_evidence: f64,
    /// The root of the posterior covariance of all weights: `weights x coordinates`.
    root: Matrix,
}

/// A piece of the model with the cosines as inputs, over an axis of times in the unit of the model.
pub(super) fn piece(
    site: &Site,
    cosines: usize,
    prefix: &str,
    (time, from, to, unit): (&str, f64, f64, &lacuna::data::Unit),
) -> (Piece, Vec<FreeInput>) {
    let name = |k: usize| format!("{prefix}{k}");
    let (begin, length) = (quantity(from, unit), quantity(to - from, unit));
    let cosine = |k: usize| match k {
        0 => name(0),
        k => format!("{} * cos({k} * pi * ({time} - {begin}) / {length})", name(k)),
    };
    let sum: Vec<String> = (0..cosines).map(cosine).collect();
    let input = |k: usize| {
        let prior = Distribution::Normal([0.0, 1.0]);
        FreeInput::new(&name(k), site.unit.clone(), 0.0, prior)
    };
    let words = || String::new();
    let piece = Piece {
        kind: prefix.to_owned(),
        description: Description { title: words(), formula: words(), source: words() },
        places: (0..cosines).collect(),
        addition: Some(Addition {
            summands: vec![(site.state.name.clone(), format!("({})", sum.join(" + ")))],
            states: Vec::new(),
        }),
        at: None,
        tried: 1,
    };
    (piece, (0..cosines).map(input).collect())
}

/// The number of cosines for an experiment.
pub(super) fn cosines(experiment: &Experiment<'_>) -> usize {
    let longest = experiment.curves.iter().map(|curve| curve.measured.len()).max().unwrap_or(0);
    let conditions =
        experiment.conditions.iter().filter(|c| !c.replicates.is_empty()).count().max(1);
    (longest / 2).min(COSINES).min(ALL / conditions).max(FEWEST)
}

impl ForceSetting<'_, '_> {
    /// The force of largest posterior density, from a calibration with the noise around it; `None` if the model has no answer.
    pub fn infer(&self, start: &[f64], noise: &Noise) -> Option<Inferred> {
        let (_, means) = self.experiment.means();
        let (measured, conditions) = (self.measured(), self.model.conditions());
        let mut parameters = start.to_vec();
        let mut weights = vec![vec![0.0; self.cosines]; conditions];
        let mut answer = self.model.answer(&parameters, &weights, &measured)?;
        let mut noise = noise.clone();
        let mut whitener = Whitener::new(self.experiment, &noise, &answer.response);
        let mut posterior = None;
        for step in 0..STEPS {
            let linear = self.linear(&answer, (&parameters, &weights), &means, &whitener);
            let next = self.posterior(&linear)?;
            let shift = linear.shift(&next.mean);
            let now = self.merit(
                &answer.response,
                (&parameters, &weights),
                &means,
                &whitener,
                &next.variances,
            );
            let moved = self.moved(
                (&parameters, &weights),
                (&shift, &next.mean),
                now,
                (&means, &whitener, &next.variances),
            );
            posterior = Some(next);
            let Some((there, own, merit)) = moved else { break };
            (parameters, weights) = (there, own);
            answer = self.model.answer(&parameters, &weights, &measured)?;
            if step == 0 && self.experiment.has_records() {
                let variances = posterior.as_ref().map(|p| &p.variances[..])?;
                noise = Noise::of(self.experiment, &self.around(&answer, variances), Some(&noise));
                whitener = Whitener::new(self.experiment, &noise, &answer.response);
            } else if now - merit < GAIN * now.abs().max(1.0) {
                break;
            }
        }
        let last =
            self.posterior(&self.linear(&answer, (&parameters, &weights), &means, &whitener));
        let Posterior { root, log_evidence, .. } = last.or(posterior)?;
        // Under conditions without data there is no force, and the parameters alone tell the response.
        let all: Vec<usize> = (0..conditions).collect();
        let response = self.model.response(&parameters, &weights, &all).unwrap_or(answer.response);
        Some(Inferred { parameters, weights, response, whitener, log_evidence, root })
    }

    /// The conditions that are measured.
    pub fn measured(&self) -> Vec<usize> {
        self.model.measured(self.experiment)
    }

    fn linear(
        &self,
        answer: &Answer,
        (parameters, weights): (&[f64], &[Vec<f64>]),
        means: &[f64],
        whitener: &Whitener,
    ) -> Linear {
        let outputs = means.len();
        let mut rows = Matrix::zeros(0, outputs);
        let mut back: Vec<f64> = means.iter().zip(&answer.response).map(|(y, m)| y - m).collect();
        for c in self.measured() {
            let own = self.model.simulator.settings[c].outputs.clone();
            for (k, weight) in weights[c].iter().enumerate() {
                let mut row = vec![0.0; outputs];
                row[own.clone()].copy_from_slice(&answer.by_inputs.row(k)[own.clone()]);
                own.clone().for_each(|i| back[i] += weight * row[i]);
                rows.push_row(&row);
            }
        }
        let directions = whitener.whiten_rows(&rows);
        let slopes = whitener.whiten_rows(&answer.by_parameters);
        let pull = Pull::of(&self.priors(), parameters);
        let residual = pull.centred(&whitener.whiten(&back), &slopes);
        let projection = Projection::off(&slopes, &pull.precisions);
        let (free, _) = projection.rest_of_rows(directions.clone());
        let information = multiply_transposed(&free, &directions);
        let score = multiply_vector(&free, &residual);
        Linear { residual, slopes, pull, directions, information, score }
    }

    fn priors(&self) -> Vec<Distribution> {
        self.experiment.parameters.iter().map(|p| p.prior.clone()).collect()
    }

    /// The posterior of the weights with the hyperparameters of largest evidence.
    fn posterior(&self, linear: &Linear) -> Option<Posterior> {
        let mut best: Option<Posterior> = None;
        for order in [1, 2] {
            for corner in CORNERS {
                let shape = |k: usize| (1.0 + (k as f64 / corner).powi(2)).powi(-order);
                let width: Vec<f64> =
                    (0..linear.score.len()).map(|a| shape(a % self.cosines).sqrt()).collect();
                let total: f64 = (0..self.cosines).map(shape).sum();
                let next = with_widths(linear, &width, self.size / total.sqrt())?;
                if best.as_ref().is_none_or(|best| next.log_evidence > best.log_evidence) {
                    best = Some(next);
                }
            }
        }
        best
    }

    /// Minus the log posterior density up to a constant.
    fn merit(
        &self,
        response: &[f64],
        (parameters, weights): (&[f64], &[Vec<f64>]),
        means: &[f64],
        whitener: &Whitener,
        variances: &[f64],
    ) -> f64 {
        let misfit: Vec<f64> = means.iter().zip(response).map(|(y, m)| y - m).collect();
        let white = whitener.whiten(&misfit);
        let all = self.measured().into_iter().flat_map(|c| &weights[c]);
        let penalty: f64 = all.zip(variances).map(|(w, v)| w * w / v).sum();
        let priors = self.priors();
        let density: f64 = priors.iter().zip(parameters).map(|(p, x)| p.log_density(*x)).sum();
        0.5 * (dot(&white, &white) + penalty) - density - log_slope(&priors, parameters)
    }

    /// The point after the longest step that improves the fit, with its merit.
    fn moved(
        &self,
        (parameters, weights): (&[f64], &[Vec<f64>]),
        (shift, mean): (&[f64], &[f64]),
        now: f64,
        (means, whitener, variances): (&[f64], &Whitener, &[f64]),
    ) -> Option<(Vec<f64>, Vec<Vec<f64>>, f64)> {
        let measured = self.measured();
        let supports = self.experiment.parameters.iter().map(|p| p.prior.support());
        let supports: Vec<(f64, f64)> = supports.collect();
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            let there: Vec<f64> = parameters
                .iter()
                .zip(shift)
                .zip(&supports)
                .map(|((x, s), (low, high))| inside(x + share * s, *x, *low, *high))
                .collect();
            let mut own = weights.to_vec();
            for (m, &c) in measured.iter().enumerate() {
                for (k, w) in own[c].iter_mut().enumerate() {
                    *w += share * (mean[m * self.cosines + k] - *w);
                }
            }
            if let Some(response) = self.model.response(&there, &own, &measured) {
                let merit = self.merit(&response, (&there, &own), means, whitener, variances);
                if merit < now {
                    return Some((there, own, merit));
                }
            }
            share *= 0.5;
        }
        None
    }

    /// The response with the changes that unknowns and force can make to it, in units of their priors' widths.
    fn around(&self, answer: &Answer, variances: &[f64]) -> ResponseTangents {
        let outputs = answer.response.len();
        let mut slopes = Matrix::zeros(0, outputs);
        for (row, prior) in answer.by_parameters.iter_rows().zip(self.priors()) {
            let width = 1.0 / precision(&prior).sqrt();
            slopes.push_row(&row.iter().map(|x| x * width).collect::<Vec<_>>());
        }
        for (m, c) in self.measured().into_iter().enumerate() {
            let own = self.model.simulator.settings[c].outputs.clone();
            for k in 0..self.cosines {
                let width = variances[m * self.cosines + k].sqrt();
                let mut row = vec![0.0; outputs];
                own.clone().for_each(|i| row[i] = width * answer.by_inputs[(k, i)]);
                slopes.push_row(&row);
            }
        }
        ResponseTangents { response: answer.response.clone(), slopes }
    }

    /// The force at times of a condition: mean and standard deviation.
    pub fn at(&self, found: &Inferred, condition: usize, span: (f64, f64)) -> (Vec<f64>, Vec<f64>) {
        let (from, to) = span;
        let place = self.measured().iter().position(|c| *c == condition);
        let value = |t: &f64| {
            let basis: Vec<f64> = (0..self.cosines)
                .map(|k| (PI * k as f64 * (t - from) / (to - from)).cos())
                .collect();
            let mean = dot(&basis, &found.weights[condition]);
            let Some(place) = place else { return (0.0, f64::INFINITY) };
            let variance: f64 = (0..found.root.columns())
                .map(|a| {
                    let begin = place * self.cosines;
                    let own = basis.iter().enumerate().map(|(k, b)| b * found.root[(begin + k, a)]);
                    own.sum::<f64>().powi(2)
                })
                .sum();
            (mean, variance.sqrt())
        };
        self.model.times(condition).iter().map(value).unzip()
    }

    /// The misfit at the inferred trajectory without the force.
    pub fn residual(&self, found: &Inferred) -> Option<Misfit> {
        let (_, means) = self.experiment.means();
        let answer = self.model.answer(&found.parameters, &found.weights, &self.measured())?;
        let point = (&found.parameters[..], &found.weights[..]);
        let Linear { residual, slopes, pull, .. } =
            self.linear(&answer, point, &means, &found.whitener);
        Some(Misfit { residual, slopes, precisions: pull.precisions })
    }
}

/// A misfit that forms may explain, whitened.
pub(super) struct Misfit {
    /// The residual, one value an output.
    pub residual: Vec<f64>,
    /// The slopes of the unknowns, `unknowns x outputs`, and the precisions of their priors.
    pub slopes: Matrix,
    pub precisions: Vec<f64>,
}

/// A value inside the ends of a support, at most nine tenths of the way to a bound.
fn inside(to: f64, from: f64, low: f64, high: f64) -> f64 {
    const WAY: f64 = 0.9;
    if to <= low {
        from + WAY * (low - from)
    } else if to >= high {
        from + WAY * (high - from)
    } else {
        to
    }
}
