//! Moves of the forward selection after a step: exchanges, deletions, and pairs where no single effect helps.

use lacuna::math::random::Stream;

use super::forward::{FURTHER, Search};
use super::refit::Weighed;
use super::state::SearchState;
use crate::gap::candidates::Placement;

/// The number of placements of each step that are tried in pairs.
const PAIRED: usize = 10;

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
            for i in 0..state.chosen.len() {
                let stream = stream.named("exchange").at(round as u64).at(i as u64);
                let (smaller, weighed) = self.slot(state, i, &stream);
                let Some(best) = weighed.first() else { continue };
                let chosen = &state.chosen[i];
                let same =
                    best.placement.candidate == chosen.candidate && best.placement.on == chosen.on;
                if same {
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
            let needless = (0..state.chosen.len() - 1).find_map(|i| {
                let smaller = state.without(&common, i);
                (smaller.weight(&common, stream) >= whole).then_some((i, smaller))
            });
            let Some((i, smaller)) = needless else { break };
            dropped.push(state.system.effects[i].name.clone());
            *state = smaller;
        }
        dropped
    }

    /// The pair of placements of largest weight; `None` if the weight is not larger than that of the present system.
    pub(super) fn pair(
        &self,
        state: &SearchState<'a>,
        weighed: &[Weighed],
        now: f64,
        [gap, least]: [f64; 2],
        stream: &Stream,
    ) -> Option<Vec<Placement>> {
        let common = self.setting();
        let promising: Vec<&Weighed> = weighed.iter().take(PAIRED).collect();
        let mut best: Option<(f64, Vec<Placement>)> = None;
        for (i, first) in promising.iter().enumerate() {
            let one =
                state.with(&common, &first.placement, &self.unknowns(&first.placement, weighed));
            for second in &promising[i + 1..] {
                let own = self.unknowns(&second.placement, weighed);
                let both = one.with(&common, &second.placement, &own);
                let weight = both.weight(&common, stream);
                let shares = || gap - both.tolerant(&common, stream).gap >= least;
                if weight > now + FURTHER
                    && shares()
                    && best.as_ref().is_none_or(|(most, _)| weight > *most)
                {
                    best = Some((weight, vec![first.placement.clone(), second.placement.clone()]));
                }
            }
        }
        best.map(|(_, pair)| pair)
    }
}
