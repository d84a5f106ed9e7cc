//! Subspace pursuit: the best set of a given number of terms (Dai and Milenkovic 2009).
//!
//! Starting from the most correlated terms, as many terms most correlated with the residual are added, and the
//! largest of all of them in the least-squares fit are kept, until the residual no longer decreases. The number of
//! terms is that with the smallest error.

use std::collections::BTreeMap;

use lacuna_linalg::vector;

use super::dictionary::{ActiveSet, Dictionary};
use super::judge::{Choice, Criterion, judged};

/// Maximum number of rounds of adding and removing terms.
const ROUNDS: usize = 30;
/// Number of consecutive set sizes that were worse than the best before the search among them ends.
const WORSE: usize = 4;

/// Chooses the terms of an output, given as its values minus their mean (`centred`) and their products with the
/// dictionary's columns (`correlations`).
pub(super) fn subspace_pursuit(
    dictionary: &Dictionary,
    centred: &[f64],
    correlations: &[f64],
    criterion: &Criterion,
) -> Option<Choice> {
    let most = dictionary.most_terms().div_ceil(2).min(dictionary.most_greedy_terms());
    let mut tried: BTreeMap<usize, f64> = BTreeMap::new();
    let mut best: Option<Choice> = None;
    let mut attempt = |terms: usize, best: &mut Option<Choice>| {
        let total = vector::dot(centred, centred);
        *tried.entry(terms).or_insert_with(|| {
            let set = pursue(dictionary, correlations, total, terms);
            if set.terms().is_empty() {
                return f64::INFINITY;
            }
            let choice = judged(set, centred, criterion);
            let error = choice.error;
            Choice::improve(best, choice);
            error
        })
    };
    // First set sizes that increase by about a fifth, then sizes between the best one and its neighbours.
    let (mut count, mut least, mut at, mut worse) = (1, f64::INFINITY, 1, 0);
    while count <= most && worse < WORSE {
        let error = attempt(count, &mut best);
        if error < least {
            (least, at, worse) = (error, count, 0);
        } else {
            worse += 1;
        }
        count += (count / 5).max(1);
    }
    let mut step = at / 10;
    while step > 0 {
        for count in [at - step, at + step] {
            if count <= most {
                let error = attempt(count, &mut best);
                if error < least {
                    (least, at) = (error, count);
                }
            }
        }
        step /= 2;
    }
    best
}

/// Returns the set of `count` terms at which the pursuit ends.
fn pursue<'a>(
    dictionary: &'a Dictionary,
    correlations: &[f64],
    total: f64,
    count: usize,
) -> ActiveSet<'a> {
    let open: Vec<usize> =
        dictionary.varies().enumerate().filter(|(_, varies)| *varies).map(|(t, _)| t).collect();
    let mut set = ActiveSet::new(dictionary);
    join(&mut set, &open, correlations, count);
    let (mut weights, mut explained) = set.solve(correlations);
    let mut residual = vec![0.0; correlations.len()];
    for _ in 0..ROUNDS {
        dictionary.combine(set.terms(), &weights, &mut residual);
        residual.iter_mut().zip(correlations).for_each(|(r, c)| *r = c - *r);
        let mut wide = set.clone();
        let others: Vec<usize> =
            open.iter().copied().filter(|t| !set.terms().contains(t)).collect();
        join(&mut wide, &others, &residual, 2 * count);
        let (sizes, _) = wide.solve(correlations);
        let order = by_size(wide.terms().len(), |i| sizes[i]);
        let mut next = ActiveSet::new(dictionary);
        for &i in order.iter().take(count) {
            next.enter(wide.terms()[i]);
        }
        let (found, more) = next.solve(correlations);
        // Differences below this fraction of the output are rounding errors.
        if more <= explained + 1e-15 * total {
            break;
        }
        (set, weights, explained) = (next, found, more);
    }
    set
}

/// Adds terms in decreasing order of `sizes` until the set has `count` terms.
fn join(set: &mut ActiveSet<'_>, terms: &[usize], sizes: &[f64], count: usize) {
    for i in by_size(terms.len(), |i| sizes[terms[i]]) {
        if set.terms().len() >= count {
            return;
        }
        set.enter(terms[i]);
    }
}

/// Returns indices by decreasing absolute size; equal ones keep their order.
fn by_size(count: usize, size: impl Fn(usize) -> f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| size(b).abs().total_cmp(&size(a).abs()));
    order
}
