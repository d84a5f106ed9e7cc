//! The class of an effect: the types that these data cannot distinguish from it.

use super::{SIGNIFICANT, SURE};
use crate::gap::candidates::{Candidate, Placement, log_group_share};
use crate::gap::search::diagnostics::SearchResult;
use crate::gap::search::simpler::{AS_MUCH, as_good};

/// The types that explain about as much as the chosen one of effect `i` where a significant remainder is left, with no
/// more unknowns, each with its share by the prior odds; empty where the chosen one may be exact. No posterior odds tell
/// them apart: odds of two inexact forms say which of them is nearer to the data, and grow with the data without either
/// of them being true (Berk, Annals of Mathematical Statistics 37 (1966) 51).
pub(super) fn alike(
    found: &SearchResult<'_>,
    candidates: &[Candidate],
    i: usize,
) -> Vec<(String, f64)> {
    if found.last.tolerant.inexact <= SIGNIFICANT {
        return Vec::new();
    }
    let (own, acts) = (&found.chosen[i], &found.system.effects[i].acts);
    let count = |placement: &Placement| unknowns(found, candidates, placement);
    let mut all: Vec<(String, f64)> = Vec::new();
    for other in as_good(&found.last.fit, acts, &found.slots[i], AS_MUCH) {
        let candidate = &candidates[other.placement.candidate];
        let is_simple = count(&other.placement) <= count(own);
        let is_known = all.iter().any(|(kind, _)| *kind == candidate.kind);
        if other.placement.on == own.on && is_simple && !is_known {
            all.push((candidate.kind.clone(), log_group_share(candidates, candidate).exp()));
        }
    }
    let sum: f64 = all.iter().map(|(_, share)| share).sum();
    for (_, share) in &mut all {
        *share /= sum;
    }
    all
}

fn unknowns(found: &SearchResult<'_>, candidates: &[Candidate], placement: &Placement) -> usize {
    let layout = &found.system.experiment.layouts.blocks[0];
    candidates[placement.candidate].effect.absent(layout).len()
}

/// Adds the next type to those that are alone in their class; returns true if every class then has several types.
pub(super) fn widened(effects: &mut [super::MissingEffect], types: &[Vec<(String, f64)>]) -> bool {
    for (effect, types) in effects.iter_mut().zip(types) {
        if effect.class.len() == 1
            && let Some((other, _)) = types.iter().find(|(other, _)| *other != effect.kind)
        {
            effect.class.push(other.clone());
        }
    }
    effects.iter().all(|effect| effect.class.len() > 1)
}

/// The most probable types that together reach 95 %; the chosen type alone if it does by itself.
pub fn class(kind: &str, own: f64, types: &[(String, f64)]) -> Vec<String> {
    let mut class = vec![kind.to_owned()];
    let mut sum = own;
    if own >= SURE {
        return class;
    }
    for (other, p) in types.iter().filter(|(other, _)| other != kind) {
        if sum >= SURE {
            break;
        }
        class.push(other.clone());
        sum += p;
    }
    class
}
