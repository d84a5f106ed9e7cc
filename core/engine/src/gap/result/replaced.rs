//! The result of a search in which another model may take the place of the study's.
//!
//! A model counts as one more type of effect. With its own calibration, and with the effects that it lacks, it is
//! compared with the study's model and its effects under the same noise. It is named if its posterior odds are at least
//! 9.

use lacuna::plugin::effect::On;
use serde::{Deserialize, Serialize};

use super::insight::{NOTHING, withhold};
use super::members::{self, Member};
use super::{AddedEffect, Estimate, GapResult, Shift, StepResult};
use crate::gap::search::{CEILING, CrossValidation, MissingEffect, SURE, VerdictKind, class};

/// The type of an added effect that is another model in place of the study's.
pub const MODEL_SWAP: &str = "model_swap";

/// Another model against the study's, neither with effects that were found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OtherModel {
    /// The name in the study.
    pub name: String,
    /// The log Bayes factor of it against the study's model.
    pub log_odds: f64,
    /// The standard error of the log Bayes factor.
    pub error: f64,
    /// The calibrated parameters: name, unit, value and standard deviation by the normal approximation.
    pub parameters: Vec<Estimate>,
}

/// A search with another model in place of the study's.
pub struct AlternativeSearch {
    /// The model as an addition, whose probability and class are still open; its unknowns are the parameters that it
    /// shares with the study's model.
    pub swap: AddedEffect,
    /// The log posterior odds of it and its effects against the study's model and its effects.
    pub log_odds: f64,
    /// The result of the search with it.
    pub result: GapResult,
    /// The share of the excess misfit of the study's model that it closes.
    pub closed: f64,
    /// True when it explains the gap, even if a single region still disagrees.
    pub explains: bool,
    /// The cross-validation against the study's model with its effects.
    pub cross_validation: Vec<CrossValidation>,
    /// The parameters of the study's model that it does not have: the medians and widths of their priors.
    pub idle: Vec<(String, f64, f64)>,
}

/// The result with the model of largest posterior probability: the study's, or another.
pub fn settled(own: GapResult, others: Vec<AlternativeSearch>) -> GapResult {
    let most = others.iter().map(|other| other.log_odds).fold(0.0, f64::max);
    let total = (-most).exp() + others.iter().map(|o| (o.log_odds - most).exp()).sum::<f64>();
    let share = |log_odds: f64| (log_odds - most).exp() / total;
    let mut shares: Vec<(String, f64)> =
        others.iter().map(|other| (other.swap.name.clone(), share(other.log_odds))).collect();
    let ours = own.additions.first().map(|addition| addition.kind.clone());
    if let Some(kind) = &ours {
        shares.push((kind.clone(), share(0.0)));
    }
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let sets = sets(&own, &others, share);
    let best = others.into_iter().max_by(|a, b| a.log_odds.total_cmp(&b.log_odds));
    let mut result = match best {
        Some(best) if best.log_odds > 0.0 => {
            let probability = share(best.log_odds);
            let class = class(&best.swap.name, probability, &shares);
            replaced(&own, best, probability, class)
        }
        _ => kept(own, share(0.0), &shares),
    };
    result.members = match result.additions.first() {
        Some(first) if result.verdict.word == VerdictKind::Class => members::settled(
            sets.into_iter().filter(|set| first.class.contains(&set.kinds[0])).collect(),
        ),
        _ => Vec::new(),
    };
    result
}

/// The explanations with the study's model and with each of the others, with their probabilities.
fn sets(own: &GapResult, others: &[AlternativeSearch], share: impl Fn(f64) -> f64) -> Vec<Member> {
    let set = |additions: Vec<AddedEffect>, weight: f64| Member {
        kinds: additions.iter().map(|addition| addition.label().to_owned()).collect(),
        weight,
        additions,
    };
    let mut all = own.members.clone();
    if all.is_empty() && !own.additions.is_empty() {
        all.push(set(own.additions.clone(), 1.0));
    }
    for member in &mut all {
        member.weight *= share(0.0);
    }
    all.extend(others.iter().map(|other| {
        let weight = share(other.log_odds);
        let class = vec![other.swap.name.clone()];
        let swap =
            AddedEffect { probability: weight, share: other.closed, class, ..other.swap.clone() };
        let additions = std::iter::once(swap).chain(other.result.additions.iter().cloned());
        set(additions.collect(), weight)
    }));
    all
}

/// The result with the study's model if others may be as good.
fn kept(mut own: GapResult, probability: f64, shares: &[(String, f64)]) -> GapResult {
    let Some(first) = own.additions.first_mut() else { return own };
    let with = class(&first.kind, probability, shares);
    first.probability *= probability;
    first.posterior_probability *= probability;
    first.class.extend(with.into_iter().skip(1));
    own.verdict.effects[0].probability = first.probability;
    own.verdict.effects[0].posterior_probability = first.posterior_probability;
    own.verdict.effects[0].class.clone_from(&first.class);
    if own.verdict.word == VerdictKind::Named && first.class.len() > 1 {
        own.verdict.word = VerdictKind::Class;
    }
    own
}

/// The result with another model in place of the study's.
fn replaced(
    own: &GapResult,
    best: AlternativeSearch,
    probability: f64,
    class: Vec<String>,
) -> GapResult {
    let AlternativeSearch {
        swap,
        log_odds,
        result: mut other,
        closed,
        explains,
        cross_validation,
        idle,
    } = best;
    let rivals = cross_validation.clone();
    let posterior_probability = probability;
    let swap = AddedEffect {
        class,
        probability: probability.min(CEILING),
        posterior_probability,
        share: closed,
        rivals,
        ..swap
    };
    let verdict = &mut other.verdict;
    verdict.closed = closed;
    verdict.effects.insert(0, named(&swap));
    let others = verdict.none_of_these.unwrap_or(0.0);
    verdict.none_of_these = Some(others.max(1.0 - swap.probability));
    let adequate = match verdict.word {
        VerdictKind::None | VerdictKind::NotVisible => true,
        VerdictKind::Unlisted if explains => {
            verdict.reasons.push(
                "a place still disagrees with the other model, though the misfit as a whole is that of noise"
                    .into(),
            );
            true
        }
        _ => false,
    };
    if adequate {
        verdict.word = VerdictKind::Named;
    }
    if verdict.word == VerdictKind::Named && swap.class.len() > 1 {
        verdict.word = VerdictKind::Class;
    }
    if adequate && swap.class.len() == 1 && probability < SURE {
        verdict.word = VerdictKind::Unlisted;
        verdict.reasons.push(format!(
            "the model `{}` explains the data, and not clearly better than the study's",
            swap.name
        ));
    }
    let passed = StepResult {
        p: own.p[0],
        leaders: own.path.first().map(|step| step.leaders.clone()).unwrap_or_default(),
        log_odds,
        added: vec![(swap.name.clone(), On::new())],
        dropped: Vec::new(),
    };
    other.path.insert(0, passed);
    other.additions.insert(0, swap);
    other.p[0] = own.p[0];
    other.regions[0].clone_from(&own.regions[0]);
    other.response[0].clone_from(&own.response[0]);
    other.left[0].clone_from(&own.left[0]);
    other.visible.clone_from(&own.visible);
    other.sizes.clone_from(&own.sizes);
    other.parameters = shifts(own, &other.parameters, &idle);
    other.insight.drift.clone_from(&own.insight.drift);
    let theirs: Vec<&str> = own.additions.iter().map(|a| a.kind.as_str()).collect();
    let against = if theirs.is_empty() { NOTHING.to_owned() } else { theirs.join(" + ") };
    (other.insight.against, other.insight.cross_validation) = (Some(against), cross_validation);
    if other.verdict.word != VerdictKind::Unlisted {
        other.insight.places.clear();
        (other.insight.smoother, other.insight.symbolic) = (None, None);
    }
    withhold(&mut other.verdict, &other.insight);
    other.additions[0].class.clone_from(&other.verdict.effects[0].class);
    other.models.clone_from(&own.models);
    other
}

fn named(swap: &AddedEffect) -> MissingEffect {
    MissingEffect {
        name: swap.name.clone(),
        kind: swap.kind.clone(),
        on: On::new(),
        values: swap.unknowns.iter().map(|unknown| unknown.value).collect(),
        sd: swap.unknowns.iter().map(|unknown| unknown.sd).collect(),
        probability: swap.probability,
        posterior_probability: swap.posterior_probability,
        traits: None,
        class: swap.class.clone(),
        share: swap.share,
        supported: true,
        contradicted: false,
        certain: false,
    }
}

/// The parameters of the study's model after the swap, as the other model has them; those that it lacks keep their
/// prior.
fn shifts(own: &GapResult, other: &[Shift], idle: &[(String, f64, f64)]) -> Vec<Shift> {
    let shift = |before: &Shift| {
        let mut shift = before.clone();
        if let Some(after) = other.iter().find(|after| after.name == before.name) {
            (shift.value[1], shift.sd[1], shift.at_bound[1]) =
                (after.value[1], after.sd[1], after.at_bound[1]);
        } else if let Some((_, median, width)) = idle.iter().find(|(name, ..)| *name == before.name)
        {
            (shift.value[1], shift.sd[1], shift.at_bound[1]) = (*median, *width, false);
        }
        shift
    };
    own.parameters.iter().map(shift).collect()
}
