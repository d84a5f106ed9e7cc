//! The end of a search: the types and the support of the effects that were found, and which of them keep their names.

use super::checks::{consistency, shares, stability};
use super::diagnostics::{Diagnostics, SearchResult, SearchStep};
use super::forward::Search;
use super::state::SearchState;
use super::support::supports;
use super::verdict::{Verdict, VerdictKind, verdict};
use super::visited::ModelAverage;

impl<'a> Search<'a> {
    /// The result of a search that ends in a state with these diagnostics.
    pub(super) fn finished(
        &self,
        state: &SearchState<'a>,
        path: Vec<SearchStep>,
        last: Diagnostics,
    ) -> SearchResult<'a> {
        let (slots, compared) = self.slots(state, &path, &self.stream.named("types"));
        let visited = path.iter().flat_map(|step| step.visited.clone()).chain(compared);
        let average = ModelAverage::of(&visited.collect::<Vec<_>>());
        let stability = match slots.last() {
            Some(weighed) => {
                let smaller = state.without(&self.setting(), state.chosen.len() - 1);
                let setting = self.setting();
                stability(self.experiment, &smaller.refit_setting(&setting), weighed)
            }
            None => 1.0,
        };
        let first = path.first().map_or(&last.fit, |step| &step.before.fit);
        let explained = state.explained(&self.setting(), first, last.tolerant.setting);
        let stream = self.stream.named("support");
        let support = supports(&self.setting(), state, &last.tolerant, &explained, &stream);
        let consistency = consistency(&state.system, &state.fit, &state.whitener);
        let types = slots.iter().map(|weighed| shares(self.candidates, weighed)).collect();
        SearchResult {
            path,
            system: state.system.clone(),
            chosen: state.chosen.clone(),
            last,
            types,
            slots,
            average,
            explained,
            support,
            uncertain: Vec::new(),
            consistency,
            stability,
            noise: state.noise.clone(),
            whitener: state.whitener.clone(),
            means: self.means.clone(),
            remainder: self.remainder.clone(),
        }
    }

    /// A part of a sum of effects, if the whole has no name and the part has one and is certain by itself: what is left of the
    /// gap is a remainder then, in the place of partners that may be false. Else the whole. The parts are the effects
    /// that are certain in the whole, and the effect that closes most.
    pub(super) fn certain_part(
        &self,
        whole: SearchResult<'a>,
        state: &SearchState<'a>,
    ) -> SearchResult<'a> {
        let told = verdict(&whole, self.candidates, self.options);
        if told.word != VerdictKind::Unlisted {
            return whole;
        }
        let count = told.effects.len();
        let certain: Vec<usize> = (0..count).filter(|&i| told.effects[i].certain).collect();
        let share = |i: &usize| told.effects[*i].share;
        let largest = (0..count).max_by(|a, b| share(a).total_cmp(&share(b)));
        let mut parts = vec![certain, Vec::from_iter(largest)];
        parts.dedup();
        parts.retain(|part| (1..count).contains(&part.len()));
        let named = parts.into_iter().find_map(|part| self.part(&whole, &told, state, &part));
        named.unwrap_or(whole)
    }

    /// The result with some of the effects alone; `None` if that has no name or one of them is not certain.
    fn part(
        &self,
        whole: &SearchResult<'a>,
        told: &Verdict,
        state: &SearchState<'a>,
        kept: &[usize],
    ) -> Option<SearchResult<'a>> {
        let dropped: Vec<usize> = (0..told.effects.len()).filter(|i| !kept.contains(i)).collect();
        let setting = self.setting();
        let smaller = dropped.iter().rev().fold(state.clone(), |s, &i| s.without(&setting, i));
        let (last, _, _) = self.diagnose(&smaller, whole.path.len() as u64 + 1);
        let mut part = self.finished(&smaller, whole.path.clone(), last);
        part.uncertain = dropped.iter().map(|&i| told.effects[i].name.clone()).collect();
        let alone = verdict(&part, self.candidates, self.options);
        let has_names = matches!(alone.word, VerdictKind::Named | VerdictKind::Approximate);
        (has_names && alone.effects.iter().all(|effect| effect.certain)).then_some(part)
    }
}
