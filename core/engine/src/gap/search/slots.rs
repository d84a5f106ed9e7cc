//! The placements that are weighed in place of each effect, beside the others.

use lacuna::math::random::Stream;
use rayon::prelude::*;

use super::diagnostics::SearchStep;
use super::forward::Search;
use super::refit::Weighed;
use super::state::SearchState;
use super::visited::VisitedModel;
use crate::gap::candidates::Placement;
use crate::gap::test::{Projection, differences};

/// A state without one of its effects, and the placements that are weighed in its place, in decreasing order of weight.
#[derive(Clone)]
pub(super) struct Slot<'a> {
    pub smaller: SearchState<'a>,
    pub weighed: Vec<Weighed>,
}

impl<'a> Search<'a> {
    /// The fitted values of all unknowns of the system with a placement, in their units; the absent values of its own if
    /// it was not fitted.
    pub(super) fn unknowns(&self, placement: &Placement, weighed: &[Weighed]) -> Vec<f64> {
        let fitted = weighed.iter().find(|j| j.placement.is(placement));
        let absent = || {
            let effect = &self.candidates[placement.candidate].effect;
            effect.absent(&self.experiment.layouts.blocks[0])
        };
        fitted.map_or_else(absent, |j| j.fit.at.point.clone())
    }

    /// The slot of effect `i`.
    pub(super) fn slot(&self, state: &SearchState<'a>, i: usize, stream: &Stream) -> Slot<'a> {
        let smaller = state.without(&self.setting(), i);
        let projection = Projection::of(&smaller.system, &smaller.fit);
        let design = self.design(&smaller, &projection);
        let (rows, spread) = differences(self.experiment);
        let left = projection.rest(&smaller.fit.residual);
        let scores = design.scores_of(&left, &smaller.whitener.whiten_rows(&rows), &spread);
        let weighed = self.weighed(&smaller, &design, &scores, &projection, stream);
        Slot { smaller, weighed }
    }

    /// The placements that are weighed in place of each effect at the end, and the models that they make.
    pub(super) fn slots(
        &self,
        state: &SearchState<'a>,
        path: &[SearchStep],
        stream: &Stream,
    ) -> (Vec<Vec<Weighed>>, Vec<VisitedModel>) {
        if let ([step], 1) = (path, state.chosen.len())
            && step.added.len() == 1
            && step.added[0].is(&state.chosen[0])
        {
            return (vec![step.weighed.clone()], Vec::new());
        }
        let slot = |i: usize| self.slot(state, i, &stream.at(i as u64));
        // The last round of exchanges, in which none was made, has weighed the slots of this state.
        let known = state.slots.as_ref().map(|slots| slots.to_vec());
        let slots: Vec<Slot<'a>> =
            known.unwrap_or_else(|| (0..state.chosen.len()).into_par_iter().map(slot).collect());
        let common = self.setting();
        let models = slots.iter().enumerate().flat_map(|(i, Slot { smaller, weighed })| {
            let now = smaller.weight(&common, &stream.at(i as u64));
            let nothing = now - smaller.prior(&common) + self.kinds();
            VisitedModel::around(self.candidates, &smaller.chosen, weighed, [now, nothing])
        });
        let models = models.collect();
        (slots.into_iter().map(|slot| slot.weighed).collect(), models)
    }
}
