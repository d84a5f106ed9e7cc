//! The state of a search: a calibrated system on its path.

use std::sync::Arc;

use lacuna::math::random::Stream;

use super::explained::Explained;
use super::refit::{RefitSetting, TolerantEvidence};
use super::slots::Slot;
use crate::gap::candidates::{Candidate, Placement};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit, fit_from};
use crate::gap::system::remainder::{Remainder, Setting, WhiteRemainder};
use crate::gap::system::whitener::Whitener;

/// A system with its fit, its noise and its whitener.
#[derive(Clone)]
pub(super) struct SearchState<'a> {
    /// The system.
    pub system: System<'a>,
    /// The effects as placements.
    pub chosen: Vec<Placement>,
    /// The best fit.
    pub fit: Fit,
    /// The noise around its response.
    pub noise: Noise,
    /// The whitener of the mean under that noise.
    pub whitener: Whitener,
    /// The remainder in its coordinates.
    pub white: Arc<WhiteRemainder>,
    /// The slots of its effects, if they were weighed.
    pub slots: Option<Arc<Vec<Slot<'a>>>>,
}

/// The data and candidates of a search, which all its states share.
#[derive(Clone, Copy)]
pub(super) struct SearchSetting<'a, 'b> {
    pub experiment: &'a Experiment<'a>,
    pub candidates: &'a [Candidate],
    pub means: &'b [f64],
    pub sensors: usize,
    pub remainder: &'b Remainder,
}

impl<'a> SearchState<'a> {
    /// The state as the setting of refits.
    pub fn refit_setting<'b>(&'b self, shared: &SearchSetting<'a, 'b>) -> RefitSetting<'a, 'b> {
        RefitSetting {
            system: &self.system,
            candidates: shared.candidates,
            whitener: &self.whitener,
            white: &self.white,
            means: shared.means,
            sensors: shared.sensors,
        }
    }

    /// The state with a further placement, refitted from these values of its unknowns, or of all unknowns of the system
    /// with it.
    pub fn with(
        &self,
        shared: &SearchSetting<'a, '_>,
        placement: &Placement,
        from: &[f64],
    ) -> Self {
        let setting = self.refit_setting(shared);
        let system = setting.with(placement);
        let starts = if from.len() == system.dimension() {
            vec![from.to_vec()]
        } else {
            setting.joint(&self.fit.at.point, placement, from)
        };
        let mut next = self.clone();
        next.chosen.push(placement.clone());
        next.refit(shared, system, &starts);
        next
    }

    /// Fits the system, estimates the noise around its response again, and fits once more.
    fn refit(&mut self, shared: &SearchSetting<'a, '_>, system: System<'a>, starts: &[Vec<f64>]) {
        let several = if starts.len() > 1 {
            fit_from(&system, &self.whitener, shared.means, starts)
        } else {
            None
        };
        let first =
            several.unwrap_or_else(|| fit(&system, &self.whitener, shared.means, &starts[0]));
        let around = system.around(&first.at);
        self.noise = Noise::of(shared.experiment, &around, Some(&self.noise));
        self.whitener = Whitener::new(shared.experiment, &self.noise, &around.response);
        self.white = Arc::new(shared.remainder.white(&self.whitener));
        self.fit = fit(&system, &self.whitener, shared.means, &first.at.point);
        self.system = system;
        self.slots = None;
    }

    /// The state without effect `i`, refitted with the same noise.
    pub fn without(&self, shared: &SearchSetting<'a, '_>, i: usize) -> Self {
        let mut chosen = self.chosen.clone();
        chosen.remove(i);
        let mut effects = self.system.effects.clone();
        let begin = shared.experiment.parameters.len()
            + effects[..i].iter().map(|e| e.absent().len()).sum::<usize>();
        let end = begin + effects.remove(i).absent().len();
        let system = System::new(shared.experiment, effects);
        let mut start = self.fit.at.point.clone();
        start.drain(begin..end);
        let fit = fit(&system, &self.whitener, shared.means, &start);
        Self { system, chosen, fit, slots: None, ..self.clone() }
    }

    /// The part of the gap that the effects close together, of which a remainder of this setting is left; `first` is the
    /// calibration without them.
    pub fn explained(
        &self,
        shared: &SearchSetting<'a, '_>,
        first: &Fit,
        setting: Option<Setting>,
    ) -> Explained {
        let measured = shared.experiment.measured();
        if self.chosen.is_empty() {
            return Explained::of(&self.white, [&self.fit, &self.fit], setting, &measured);
        }
        let bare = System::new(shared.experiment, Vec::new());
        let own = self.system.parameters(&self.fit.at.point).to_vec();
        let starts = [own, first.at.point.clone()];
        let fit = fit_from(&bare, &self.whitener, shared.means, &starts);
        let before = fit.as_ref().unwrap_or(&self.fit);
        Explained::of(&self.white, [before, &self.fit], setting, &measured)
    }

    /// The fitted values of the unknowns of effect `i`, in their units.
    pub fn unknowns_of(&self, i: usize) -> Vec<f64> {
        let effects = &self.system.effects;
        let begin = self.system.experiment.parameters.len()
            + effects[..i].iter().map(|e| e.absent().len()).sum::<usize>();
        self.fit.at.point[begin..begin + effects[i].absent().len()].to_vec()
    }

    /// The log evidence plus the log prior mass of the effects. Noise that is estimated from single records changes
    /// with the residual, so that its determinant is included there.
    pub fn weight(&self, shared: &SearchSetting<'a, '_>, stream: &Stream) -> f64 {
        let of_noise = if self.noise.is_assumed() { self.whitener.log_determinant() } else { 0.0 };
        self.tolerant(shared, stream).value + of_noise + self.prior(shared)
    }

    /// The evidence with a remainder.
    pub fn tolerant(&self, shared: &SearchSetting<'a, '_>, stream: &Stream) -> TolerantEvidence {
        self.refit_setting(shared).weigh(&self.system, &self.fit, stream)
    }

    /// The log prior mass of the effects: of their types and placements.
    pub fn prior(&self, shared: &SearchSetting<'a, '_>) -> f64 {
        let setting = self.refit_setting(shared);
        let kinds = (kinds(shared.candidates) as f64).ln();
        self.chosen.iter().map(|s| setting.log_prior(s) - kinds).sum()
    }
}

/// The number of types of effects.
pub fn kinds(candidates: &[Candidate]) -> usize {
    let mut names: Vec<&str> = candidates.iter().map(|c| c.kind.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names.len().max(1)
}
