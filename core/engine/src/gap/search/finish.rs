//! The end of a search: the types and the support of the effects that were found, and which of them keep their names.

use super::checks::{consistency, shares, stability};
use super::diagnostics::{Diagnostics, SearchResult, SearchStep};
use super::forward::Search;
use super::state::SearchState;
use super::support::supports;
use super::verdict::{VerdictKind, verdict};
use super::visited::ModelAverage;

impl<'a> Search<'a> {
    /// The result of a search that ends in a state with these diagnostics.
    pub(super) fn finished(
        &self,
        state: &SearchState<'a>,
        path: Vec<SearchStep>,
        last: Diagnostics,
    ) -> SearchResult<'a> {
        let (slots, compared) = self.slots(state, &path);
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
        let first = path.first().map_or(last.tolerant.gap, |step| step.before.tolerant.gap);
        let stream = self.stream.named("support");
        let support = supports(&self.setting(), state, &last.tolerant, first, &stream);
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

    /// The result without the effects that are not certain, if the whole has no name and its certain part explains most of
    /// the gap by itself: what is left of it is a remainder then, in the place of partners that may be false. Else the whole.
    pub(super) fn certain_part(
        &self,
        whole: SearchResult<'a>,
        state: &SearchState<'a>,
    ) -> SearchResult<'a> {
        let told = verdict(&whole, self.candidates, self.options);
        let (certain, uncertain): (Vec<_>, Vec<_>) =
            told.effects.iter().enumerate().partition(|(_, effect)| effect.certain);
        if told.word != VerdictKind::Unlisted || certain.is_empty() || uncertain.is_empty() {
            return whole;
        }
        let smaller = uncertain
            .iter()
            .rev()
            .fold(state.clone(), |state, (i, _)| state.without(&self.setting(), *i));
        let (last, _, _) = self.diagnose(&smaller, whole.path.len() as u64 + 1);
        let mut part = self.finished(&smaller, whole.path.clone(), last);
        part.uncertain = uncertain.into_iter().map(|(_, effect)| effect.name.clone()).collect();
        let word = verdict(&part, self.candidates, self.options).word;
        let has_names = matches!(word, VerdictKind::Named | VerdictKind::Approximate);
        if has_names { part } else { whole }
    }
}
