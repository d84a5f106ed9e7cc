//! The support of each effect at the end of a search: how much of the gap it closes beside the others, and whether it
//! predicts left-out data better than a free form in its place.
//!
//! The rival of an effect is the system without it and with a remainder, the Gaussian process of
//! [`remainder`](crate::gap::system::remainder). A wrong effect describes the data from which it was found as well as
//! any flexible form does; only what is right in its form predicts data of which the free form knows nothing.

use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::CommonError;
use serde::{Deserialize, Serialize};

use super::cross_validate::{CrossValidation, Explanation, LeftOut, STRONG, cross_validate_parts};
use super::explained::Explained;
use super::folds::Fold;
use super::refit::TolerantEvidence;
use super::state::{SearchSetting, SearchState};
use crate::gap::experiment::Experiment;

/// The largest share of an effect in a left-out part: of an effect that is nearly all there, the rest knows only the prior.
const THERE: f64 = 0.8;

/// The smallest share of an effect in a left-out part: one in which it changes next to nothing says nothing of it.
const LITTLE: f64 = 0.01;

/// The support of one effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Support {
    /// The share of the whole gap that it closes beside the other effects.
    pub share: f64,
    /// The share of the misfit on its own sensors beyond noise that it closes beside the other effects.
    pub local: f64,
    /// The cross-validation against a free form in its place.
    pub against_free_form: Vec<CrossValidation>,
}

impl Support {
    /// True when it [is proven](CrossValidation::is_proven) to predict each deciding kind of left-out data better than the
    /// free form. Without data that could be left out nothing contradicts it.
    pub fn is_proven(&self) -> bool {
        self.deciding().all(CrossValidation::is_proven)
    }

    /// True when it predicts each deciding kind better by so many standard errors.
    pub fn is_better(&self, errors: f64) -> bool {
        self.deciding().all(|one| one.is_better(errors))
    }

    /// True when the free form predicts some kind better by so many standard errors.
    pub fn is_contradicted(&self, errors: f64) -> bool {
        !self.against_free_form.iter().all(|one| one.is_better(-errors))
    }

    fn deciding(&self) -> impl Iterator<Item = &CrossValidation> {
        let all = &self.against_free_form;
        all.iter().filter(|one| decides(one, all))
    }

    /// True when it foretells the blocks together better than the free form, by 20 to 1, and none of them worse by as
    /// much. Where no block can be foretold nothing speaks against it.
    pub fn foretells(&self) -> bool {
        let is_foretold = |one: &CrossValidation| one.difference > STRONG && one.against == 0;
        let all = &self.against_free_form;
        all.iter().all(|one| one.left_out != LeftOut::Block || is_foretold(one))
    }
}

/// True when a kind of left-out data decides whether a name transfers: conditions, sensors and blocks, where some could be
/// left out. Replicates share the mean curve, to which a free form fits as well, so that they decide only where nothing
/// else could be left out.
pub fn decides(one: &CrossValidation, all: &[CrossValidation]) -> bool {
    let elsewhere = |other: &CrossValidation| other.left_out != LeftOut::Replicate;
    elsewhere(one) || !all.iter().any(elsewhere)
}

/// The support of each effect of a state; `last` is its evidence with a remainder, `whole` the gap without any effect.
pub(super) fn supports<'a>(
    shared: &SearchSetting<'a, '_>,
    state: &SearchState<'a>,
    last: &TolerantEvidence,
    whole: &Explained,
    stream: &Stream,
) -> Vec<Support> {
    let remainder = |evidence: &TolerantEvidence| -> Option<CommonError> {
        let outputs = shared.experiment.outputs() as f64;
        evidence.setting.map(|setting| shared.remainder.common(setting, outputs))
    };
    let left = remainder(last);
    let measured = shared.experiment.measured();
    let with = Explanation { system: &state.system, fit: &state.fit, remainder: left.as_ref() };
    let support = |i: usize| {
        let smaller = state.without(shared, i);
        let evidence = smaller.tolerant(shared, &stream.at(i as u64));
        let form = remainder(&evidence);
        let rival =
            Explanation { system: &smaller.system, fit: &smaller.fit, remainder: form.as_ref() };
        let acts = &state.system.effects[i].acts;
        let change = change(state, shared.experiment, i);
        let is_used = |fold: &Fold| {
            let share = share_in(shared.experiment, &change, fold);
            fold.replicate.is_some() || (LITTLE..=THERE).contains(&share)
        };
        let explained = |acts: &[bool]| {
            Explained::of(&state.white, [&smaller.fit, &state.fit], last.setting, acts)
        };
        let own: Vec<bool> = acts.iter().zip(&measured).map(|(a, b)| *a && *b).collect();
        Support {
            share: explained(&measured).closed / whole.total().max(1.0),
            local: explained(&own).share(),
            against_free_form: cross_validate_parts(with, rival, &state.noise, 1, is_used),
        }
    };
    (0..state.chosen.len()).map(support).collect()
}

/// The squared change of each output by effect `i` in units of the noise.
fn change(state: &SearchState<'_>, experiment: &Experiment<'_>, i: usize) -> Vec<f64> {
    let begin = experiment.parameters.len()
        + state.system.effects[..i].iter().map(|e| e.absent().len()).sum::<usize>();
    let absent = state.system.effects[i].absent();
    let mut point = state.fit.at.point.clone();
    point[begin..begin + absent.len()].copy_from_slice(&absent);
    let without = state.system.responses(&[point]).remove(0);
    let response = &state.fit.at.response;
    let sd = state.noise.sd(experiment, response);
    let each = response.iter().zip(without).zip(sd);
    each.map(|((with, without), sd)| ((with - without) / sd.max(f64::MIN_POSITIVE)).powi(2))
        .collect()
}

/// The share of an effect that lies in a part and in the neighbourhood that is hidden with it.
fn share_in(experiment: &Experiment<'_>, change: &[f64], fold: &Fold) -> f64 {
    let (mut inside, mut all) = (0.0, f64::MIN_POSITIVE);
    for (c, condition) in experiment.conditions.iter().enumerate() {
        for i in condition.outputs.clone().filter(|&i| change[i].is_finite()) {
            all += change[i];
            let is_there = (fold.left_out)(c, 0, i) || (fold.hidden)(c, 0, i);
            inside += if is_there { change[i] } else { 0.0 };
        }
    }
    inside / all
}
