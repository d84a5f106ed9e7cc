//! How probable each type of effect is.

use super::leaders::Judged;
use crate::gap::candidates::Candidate;

/// The probability of each type among what was weighed for one place, the most probable first.
pub(super) fn shares(candidates: &[Candidate], judged: &[Judged]) -> Vec<(String, f64)> {
    let best = judged.first().map_or(0.0, |j| j.log_weight);
    let mut shares: Vec<(String, f64)> = Vec::new();
    for j in judged {
        let kind = &candidates[j.suspect.candidate].kind;
        let weight = (j.log_weight - best).exp();
        match shares.iter_mut().find(|(other, _)| other == kind) {
            Some((_, sum)) => *sum += weight,
            None => shares.push((kind.clone(), weight)),
        }
    }
    let total: f64 = shares.iter().map(|(_, w)| w).sum();
    for (_, w) in &mut shares {
        *w /= total;
    }
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}
