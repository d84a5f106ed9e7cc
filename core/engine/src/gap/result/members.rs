//! The members of a class: the effects, each in the place of the one that was chosen, that these data cannot tell apart.

use lacuna::plugin::discrepancy::Hyperparameter;
use serde::{Deserialize, Serialize};

use super::{AddedEffect, Estimate};
use crate::gap::candidates::Candidate;
use crate::gap::search::{SearchResult, Verdict, VerdictKind, Weighed};

/// The largest number of members that are kept.
const MOST: usize = 6;

/// A member of a class, as a study adds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Member {
    /// The types of its effects.
    pub kinds: Vec<String>,
    /// The posterior probability among the members.
    pub weight: f64,
    /// The effects.
    pub additions: Vec<AddedEffect>,
}

/// The members of the class of a verdict, the most probable first; empty if the verdict is no class. Each effect whose
/// type is uncertain is replaced by the others of its class that were fitted in its place; probabilities of several such
/// effects multiply.
pub(super) fn members(
    found: &SearchResult<'_>,
    candidates: &[Candidate],
    verdict: &Verdict,
    additions: &[AddedEffect],
) -> Vec<Member> {
    if verdict.word != VerdictKind::Class {
        return Vec::new();
    }
    let mut all = vec![Member { kinds: Vec::new(), weight: 1.0, additions: Vec::new() }];
    for (i, chosen) in additions.iter().enumerate() {
        let is_taken = |name: &str| {
            additions.iter().enumerate().any(|(j, other)| j != i && other.name == name)
        };
        let forms = forms(found, candidates, i, chosen, &is_taken);
        let with = |member: &Member| -> Vec<Member> {
            let extended = forms.iter().map(|(weight, form)| {
                let mut next = member.clone();
                next.kinds.push(form.kind.clone());
                next.weight *= weight;
                next.additions.push(form.clone());
                next
            });
            extended.collect()
        };
        all = all.iter().flat_map(with).collect();
    }
    settled(all)
}

/// The most probable members, with probabilities that add up to one; none if there is only one.
pub(super) fn settled(mut all: Vec<Member>) -> Vec<Member> {
    all.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    all.truncate(MOST);
    let sum: f64 = all.iter().map(|member| member.weight).sum();
    if all.len() < 2 || sum <= 0.0 {
        return Vec::new();
    }
    for member in &mut all {
        member.weight /= sum;
    }
    all
}

/// The effect at place `i` with its probability, and the other types of its class that were fitted in its place.
fn forms(
    found: &SearchResult<'_>,
    candidates: &[Candidate],
    i: usize,
    chosen: &AddedEffect,
    is_taken: &dyn Fn(&str) -> bool,
) -> Vec<(f64, AddedEffect)> {
    let weight = |kind: &str| {
        found.types[i].iter().find(|(other, _)| other == kind).map_or(0.0, |(_, p)| *p)
    };
    let mut forms = vec![(weight(&chosen.kind), chosen.clone())];
    for kind in chosen.class.iter().filter(|kind| **kind != chosen.kind) {
        let is_it = |j: &&Weighed| candidates[j.placement.candidate].kind == *kind;
        if let Some(best) = found.slots[i].iter().find(is_it) {
            let name = if is_taken(kind) { format!("{kind}_2") } else { kind.clone() };
            let form = form(found, candidates, best, name);
            let class = std::iter::once(kind).chain(chosen.class.iter().filter(|k| *k != kind));
            let (probability, class) = (weight(kind), class.cloned().collect());
            forms.push((
                probability,
                AddedEffect { probability, class, share: chosen.share, ..form },
            ));
        }
    }
    forms
}

/// An effect that was weighed in the place of the chosen one.
fn form(
    found: &SearchResult<'_>,
    candidates: &[Candidate],
    weighed: &Weighed,
    name: String,
) -> AddedEffect {
    let candidate = &candidates[weighed.placement.candidate];
    let described = candidate.effect.describe();
    let placed = weighed.placement.placed(found.system.experiment, candidates, &name);
    let unknowns = placed.hyperparameters();
    // The unknowns of the placement come last in its fit.
    let (point, sd) = (&weighed.fit.at.point, weighed.fit.sd());
    let begin = point.len() - unknowns.len();
    let estimate = |(k, unknown): (usize, Hyperparameter)| Estimate {
        name: unknown.name,
        unit: unknown.unit,
        value: point[begin + k],
        sd: sd[begin + k],
    };
    AddedEffect {
        name,
        kind: candidate.kind.clone(),
        plugin: candidate.plugin.clone(),
        title: described.title,
        formula: described.formula,
        on: weighed.placement.on.clone(),
        options: candidate.options.clone(),
        switches: candidate.effect.switches().to_vec(),
        model: false,
        unknowns: unknowns.into_iter().enumerate().map(estimate).collect(),
        class: Vec::new(),
        probability: 0.0,
        posterior_probability: 0.0,
        share: 0.0,
        certain: false,
        rivals: Vec::new(),
    }
}
