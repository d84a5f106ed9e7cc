//! A calibrated system on the path of a search.

use super::leaders::Desk;
use crate::gap::candidates::{Candidate, Suspect};
use crate::gap::experiment::Experiment;
use crate::gap::fit::{Fit, fit};
use crate::gap::noise::{Around, Noise};
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::math::random::Stream;

/// A system with its fit and what is made of it.
#[derive(Clone)]
pub(super) struct State<'a> {
    /// The system.
    pub system: System<'a>,
    /// Its effects as suspects.
    pub chosen: Vec<Suspect>,
    /// Its best fit.
    pub fit: Fit,
    /// The noise around its response.
    pub noise: Noise,
    /// Made of the noise.
    pub whitener: Whitener,
}

/// What all states of a search share.
#[derive(Clone, Copy)]
pub(super) struct Common<'a, 'b> {
    pub experiment: &'a Experiment<'a>,
    pub candidates: &'a [Candidate],
    pub means: &'b [f64],
    pub sensors: usize,
}

impl<'a> State<'a> {
    /// The state as refits work with it.
    pub fn desk<'b>(&'b self, common: &Common<'a, 'b>) -> Desk<'a, 'b> {
        Desk {
            system: &self.system,
            candidates: common.candidates,
            whitener: &self.whitener,
            means: common.means,
            sensors: common.sensors,
        }
    }

    /// The state with a suspect whose unknowns start here.
    pub fn with(&self, common: &Common<'a, '_>, suspect: &Suspect, own: &[f64]) -> Self {
        let system = self.desk(common).with(suspect);
        let start: Vec<f64> = self.fit.at.point.iter().chain(own).copied().collect();
        let mut next = self.clone();
        next.chosen.push(suspect.clone());
        next.refit(common, system, &start);
        next
    }

    /// The system fitted anew, with the noise around its response.
    fn refit(&mut self, common: &Common<'a, '_>, system: System<'a>, start: &[f64]) {
        let first = fit(&system, &self.whitener, common.means, start);
        let around = Around::fit(&system, &first.at);
        self.noise = Noise::of(common.experiment, &around, Some(&self.noise));
        self.whitener = Whitener::new(common.experiment, &self.noise, &around.response);
        self.fit = fit(&system, &self.whitener, common.means, &first.at.point);
        self.system = system;
    }

    /// The state without one of its effects, refitted with the same noise.
    pub fn without(&self, common: &Common<'a, '_>, i: usize) -> Self {
        let mut chosen = self.chosen.clone();
        chosen.remove(i);
        let mut effects = self.system.effects.clone();
        let begin = common.experiment.parameters.len()
            + effects[..i].iter().map(|e| e.absent().len()).sum::<usize>();
        let end = begin + effects.remove(i).absent().len();
        let system = System::new(common.experiment, effects);
        let mut start = self.fit.at.point.clone();
        start.drain(begin..end);
        let fit = fit(&system, &self.whitener, common.means, &start);
        Self { system, chosen, fit, noise: self.noise.clone(), whitener: self.whitener.clone() }
    }

    /// The log of evidence times the prior masses of the effects. Where the noise is assumed it changes with what is left, and
    /// what it alone decides counts.
    pub fn weight(&self, common: &Common<'a, '_>, stream: &Stream) -> f64 {
        let weighed = super::weigh(&self.system, &self.whitener, common.means, &self.fit, stream);
        let of_noise = if self.noise.is_assumed() { self.whitener.log_determinant() } else { 0.0 };
        weighed.log_evidence + of_noise + self.prior(common)
    }

    /// The log prior mass of the effects: of their types and of their places.
    pub fn prior(&self, common: &Common<'a, '_>) -> f64 {
        let desk = self.desk(common);
        let kinds = (kinds(common.candidates) as f64).ln();
        self.chosen.iter().map(|s| desk.log_prior(s) - kinds).sum()
    }
}

/// The number of types of effects.
pub fn kinds(candidates: &[Candidate]) -> usize {
    let mut names: Vec<&str> = candidates.iter().map(|c| c.kind.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names.len().max(1)
}
