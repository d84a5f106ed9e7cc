//! A forward map with effects: one vector of unknowns, the response and its derivatives.

use super::experiment::Experiment;
use crate::linalg::Matrix;
use crate::math::distribution::Distribution;
use crate::plugin::effect::{Placed, with_tangents};

/// The experiment's forward map with effects on top; the unknowns are its parameters, then those of the effects.
#[derive(Clone)]
pub struct System<'a> {
    /// The experiment.
    pub experiment: &'a Experiment<'a>,
    /// The effects in the order in which they act.
    pub effects: Vec<Placed<'a>>,
    priors: Vec<Distribution>,
}

/// The response at a point with its derivatives.
#[derive(Debug, Clone)]
pub struct Linearised {
    /// The unknowns.
    pub point: Vec<f64>,
    /// The response.
    pub response: Vec<f64>,
    /// Its derivative by each unknown, one a row.
    pub tangents: Matrix,
}

impl<'a> System<'a> {
    /// An experiment with effects.
    pub fn new(experiment: &'a Experiment<'a>, effects: Vec<Placed<'a>>) -> Self {
        let own = experiment.parameters.iter().map(|p| p.prior.clone());
        let mut priors: Vec<Distribution> = own.collect();
        for effect in &effects {
            priors.extend(effect.hyperparameters().into_iter().map(|h| h.prior));
        }
        Self { experiment, effects, priors }
    }

    /// The same with one more effect.
    pub fn with(&self, effect: Placed<'a>) -> Self {
        let mut effects = self.effects.clone();
        effects.push(effect);
        Self::new(self.experiment, effects)
    }

    /// The number of unknowns.
    pub fn dimension(&self) -> usize {
        self.priors.len()
    }

    /// The prior of each unknown.
    pub fn priors(&self) -> &[Distribution] {
        &self.priors
    }

    /// Where each unknown may lie.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        let region = self.experiment.region.as_ref();
        let bound = |(j, prior): (usize, &Distribution)| {
            let (low, high) = prior.support();
            region.and_then(|r| r.get(j)).map_or((low, high), |r| (low.max(r.0), high.min(r.1)))
        };
        self.priors.iter().enumerate().map(bound).collect()
    }

    /// The log prior density.
    pub fn log_prior(&self, point: &[f64]) -> f64 {
        self.priors.iter().zip(point).map(|(prior, &x)| prior.log_density(x)).sum()
    }

    /// The response; values that are not finite where the forward map has no answer.
    pub fn response(&self, point: &[f64]) -> Vec<f64> {
        self.responses(&[point]).remove(0)
    }

    /// The responses at several points.
    pub fn responses<P: AsRef<[f64]>>(&self, points: &[P]) -> Vec<Vec<f64>> {
        let d = self.experiment.parameters.len();
        let theta = Matrix::from_rows(d, points.iter().map(|p| &p.as_ref()[..d]));
        let means = self.experiment.forward.mean(&theta);
        let with_effects = |(mean, point): (&[f64], &P)| {
            let mut response = mean.to_vec();
            let mut begin = d;
            for effect in &self.effects {
                let end = begin + effect.absent().len();
                response = effect.apply(&response, &point.as_ref()[begin..end]);
                begin = end;
            }
            response
        };
        means.iter_rows().zip(points).map(with_effects).collect()
    }

    /// The response with its derivatives.
    pub fn linearised(&self, point: &[f64]) -> Linearised {
        let d = self.experiment.parameters.len();
        let (mean, jacobian) = self.experiment.forward.mean_and_jacobian(&point[..d]);
        let mut begin = d;
        let effects = self.effects.iter().map(|effect| {
            let own = begin..begin + effect.absent().len();
            begin = own.end;
            (effect, &point[own])
        });
        let (response, tangents) = with_tangents(effects, mean, &jacobian);
        Linearised { point: point.to_vec(), response, tangents }
    }
}
