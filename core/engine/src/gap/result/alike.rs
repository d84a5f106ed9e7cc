//! Pairs of effects that together look like another.

use crate::gap::candidates::Candidate;
use crate::gap::search::SearchResult;

/// A sentence for each pair of effects of one type that act against each other on one sensor and look like another
/// effect: a gauge beside its place shows more of one neighbour's curve and less of the other's.
pub(super) fn opposites(found: &SearchResult<'_>, candidates: &[Candidate]) -> Vec<String> {
    let mut begin = found.system.experiment.parameters.len();
    let mut sizes = Vec::new();
    for effect in &found.system.effects {
        let absent = effect.absent();
        sizes.push(found.last.fit.at.point[begin] - absent[0]);
        begin += absent.len();
    }
    let mut sentences = Vec::new();
    for (j, second) in found.chosen.iter().enumerate() {
        let own = &candidates[second.candidate].kind;
        let opposite = found.chosen[..j].iter().zip(&sizes).any(|(first, size)| {
            let is_same = candidates[first.candidate].kind == *own && first.on == second.on;
            is_same && size * sizes[j] < 0.0
        });
        let looks_like = candidates[second.candidate].effect.looks_like();
        if opposite && !looks_like.is_empty() && !second.on.is_empty() {
            let other: Vec<String> = looks_like.iter().map(|kind| format!("`{kind}`")).collect();
            let labels: Vec<&str> = second.on.values().flatten().map(String::as_str).collect();
            sentences.push(format!(
                "two opposite effects `{own}` at {} together look like {}: suspect that first",
                labels.join(", "),
                other.join(" or ")
            ));
        }
    }
    sentences
}
