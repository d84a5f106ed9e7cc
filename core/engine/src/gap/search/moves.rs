//! Moves of the forward selection after a step: exchanges, deletions, and effects that are joined into one.

use std::sync::Arc;

use lacuna::math::random::Stream;
use lacuna::plugin::effect::Reach;
use rayon::prelude::*;

use super::forward::Search;
use super::slots::Slot;
use super::state::SearchState;
use super::subsets::{members, place_of};
use crate::gap::candidates::Placement;
use crate::gap::system::fit::fit;

/// The largest number of rounds of exchanges.
const EXCHANGES: usize = 10;

impl<'a> Search<'a> {
    /// Exchanges effects for placements of larger weight.
    pub(super) fn exchange(&self, state: &mut SearchState<'a>, stream: &Stream) {
        if state.chosen.len() < 2 {
            return;
        }
        for round in 0..EXCHANGES {
            let mut exchanged = false;
            let mut slots = Vec::new();
            for i in 0..state.chosen.len() {
                let stream = stream.named("exchange").at(round as u64).at(i as u64);
                let slot = self.slot(state, i, &stream);
                slots.push(slot.clone());
                let Slot { smaller, weighed } = slot;
                let Some(best) = weighed.first() else { continue };
                let chosen = &state.chosen[i];
                if best.placement.is(chosen) {
                    continue;
                }
                let own = self.unknowns(&best.placement, &weighed);
                let next = smaller.with(&self.setting(), &best.placement, &own);
                // The margin is above the error of the evidences: without it two states could alternate.
                if next.weight(&self.setting(), &stream)
                    > state.weight(&self.setting(), &stream) + 1.0
                {
                    *state = next;
                    exchanged = true;
                    break;
                }
            }
            if !exchanged {
                state.slots = Some(Arc::new(slots));
                break;
            }
        }
    }

    /// Drops effects without which the weight is larger, and returns their names. The last one added stays.
    pub(super) fn drop_needless(
        &self,
        state: &mut SearchState<'a>,
        stream: &Stream,
    ) -> Vec<String> {
        let common = self.setting();
        // The last effect was just found necessary beside the others; the others were not tested beside it.
        let mut dropped = Vec::new();
        while state.chosen.len() > 1 {
            let whole = state.weight(&common, stream);
            let needless = (0..state.chosen.len() - 1).into_par_iter().find_map_first(|i| {
                let smaller = state.without(&common, i);
                (smaller.weight(&common, stream) >= whole).then_some((i, smaller))
            });
            let Some((i, smaller)) = needless else { break };
            dropped.push(state.system.effects[i].name.clone());
            *state = smaller;
        }
        dropped
    }

    /// Joins effects of one candidate on several sets of sensors into one effect on all of them, as long as that has the
    /// larger weight: one size in place of several.
    pub(super) fn merge(&self, state: &mut SearchState<'a>, stream: &Stream) {
        let common = self.setting();
        while let Some(joined) = self.joined(state) {
            if joined.weight(&common, stream) < state.weight(&common, stream) {
                break;
            }
            *state = joined;
        }
    }

    /// The state of largest weight, by Laplace's method, in which two effects of one candidate are one; `None` if none
    /// has a larger weight than the state itself.
    fn joined(&self, state: &SearchState<'a>) -> Option<SearchState<'a>> {
        let common = self.setting();
        let mut best: Option<(f64, SearchState<'a>, Placement, Vec<f64>)> = None;
        for j in 1..state.chosen.len() {
            for i in 0..j {
                let [a, b] = [&state.chosen[i], &state.chosen[j]];
                let reach = self.candidates[a.candidate].effect.reach();
                if a.candidate != b.candidate || reach != Reach::Any {
                    continue;
                }
                let sets = [a, b].map(|p| members(&self.sensors, &p.on));
                let [Some(first), Some(second)] = sets else { continue };
                let on = place_of(&self.sensors, first | second);
                let placement = Placement { candidate: a.candidate, on };
                let own = state.unknowns_of(i);
                let smaller = state.without(&common, j).without(&common, i);
                let setting = smaller.refit_setting(&common);
                let start = [&smaller.fit.at.point[..], &own].concat();
                let one = fit(&setting.with(&placement), setting.whitener, setting.means, &start);
                let Some(glance) = setting.glance(&placement, &one) else { continue };
                let weight = glance + smaller.prior(&common) - self.kinds();
                if best.as_ref().is_none_or(|(most, ..)| weight > *most) {
                    let own = one.at.point[smaller.fit.at.point.len()..].to_vec();
                    best = Some((weight, smaller, placement, own));
                }
            }
        }
        let now = state.white.glance(&state.fit)? + state.prior(&common);
        let (weight, smaller, placement, own) = best?;
        (weight > now).then(|| smaller.with(&common, &placement, &own))
    }
}
