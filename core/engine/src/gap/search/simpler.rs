//! Simpler forms at the end of a search: where what was chosen leaves a misfit, a form with fewer unknowns that leaves about
//! as little takes its place.
//!
//! Under an exact form the evidence decides, as a form with more unknowns then fits the noise at most. Where no form is
//! exact it does not: a flexible form may win by an error of its own that happens to be smoother than that of the
//! simple one.

use lacuna::math::random::Stream;

use super::diagnostics::SearchStep;
use super::explained::misfit;
use super::forward::Search;
use super::refit::Weighed;
use super::state::SearchState;
use crate::gap::candidates::Placement;
use crate::gap::system::fit::Fit;

/// The number of standard deviations of the sum of squares of noise from which a misfit is more than noise.
const CLEAR: f64 = 4.0;

/// The largest misfit that a form leaves, relative to that of another form with no fewer unknowns, for both to explain as
/// much.
pub(super) const AS_MUCH: f64 = 1.25;

/// The largest misfit that a form leaves, relative to that of a form with more unknowns, for it to take its place: a flexible
/// form describes a part of any misfit.
const SIMPLER: f64 = 2.0;

/// The placements of a slot that leave at most a multiple of the misfit of the fit with the chosen one, where that leaves
/// more than noise on the outputs on which it acts.
pub(super) fn as_good<'b>(
    fit: &Fit,
    acts: &[bool],
    slot: &'b [Weighed],
    most: f64,
) -> impl Iterator<Item = &'b Weighed> {
    let (left, is_clear) = (misfit(fit, acts), leaves_misfit(fit, acts));
    let leaves_as_little = move |other: &&Weighed| misfit(&other.fit, acts) <= most * left;
    slot.iter().filter(move |_| is_clear).filter(leaves_as_little)
}

/// True if a fit leaves more than noise on some outputs.
fn leaves_misfit(fit: &Fit, acts: &[bool]) -> bool {
    let values = acts.iter().filter(|acts| **acts).count() as f64;
    misfit(fit, acts) > CLEAR * (2.0 * values).sqrt()
}

impl<'a> Search<'a> {
    /// Exchanges effects for simpler ones of the same group in the same place that explain as much; true if some were.
    pub(super) fn simplify(
        &self,
        state: &mut SearchState<'a>,
        path: &[SearchStep],
        stream: &Stream,
    ) -> bool {
        let mut simplified = false;
        for round in 0..state.chosen.len() {
            if !state.system.effects.iter().any(|e| leaves_misfit(&state.fit, &e.acts)) {
                break;
            }
            let slots = self.slots(state, path, &stream.at(round as u64)).0;
            let simpler = (0..state.chosen.len()).find_map(|i| self.simpler(state, i, &slots[i]));
            let Some(next) = simpler else { break };
            *state = next;
            simplified = true;
        }
        simplified
    }

    /// The state with the simplest form in place of effect `i`; `None` if its own is as simple.
    fn simpler(
        &self,
        state: &SearchState<'a>,
        i: usize,
        slot: &[Weighed],
    ) -> Option<SearchState<'a>> {
        let (own, acts) = (&state.chosen[i], &state.system.effects[i].acts);
        let inside = |p: &Placement| self.candidates[p.candidate].is_inside();
        let others = as_good(&state.fit, acts, slot, SIMPLER).filter(|other| {
            let there = &other.placement;
            there.on == own.on
                && inside(there) == inside(own)
                && self.count(there) < self.count(own)
                && !state.chosen.iter().any(|chosen| chosen.is(there))
        });
        let left = |other: &Weighed| misfit(&other.fit, acts);
        let best = others.min_by(|a, b| {
            let counts = self.count(&a.placement).cmp(&self.count(&b.placement));
            counts.then(left(a).total_cmp(&left(b)))
        })?;
        let smaller = state.without(&self.setting(), i);
        let next =
            smaller.with(&self.setting(), &best.placement, &self.unknowns(&best.placement, slot));
        let most = SIMPLER * misfit(&state.fit, acts);
        (misfit(&next.fit, acts) <= most).then_some(next)
    }

    /// The number of unknowns of a placement.
    fn count(&self, placement: &Placement) -> usize {
        let layout = &self.experiment.layouts.blocks[0];
        self.candidates[placement.candidate].effect.absent(layout).len()
    }
}
