//! The account of a search in which another model may take the place of the study's.
//!
//! A model is one more type of what may be missing: with its own calibration, and the effects that are missing with it, it is
//! weighed against the study's model with all its effects under the same noise. Where the odds are clear it is the name.

use serde::{Deserialize, Serialize};

use super::account::{Account, Addition, Estimate, Passed, Shift};
use super::insight::{NOTHING, withhold};
use super::name::{Foretelling, Named, SURE, Word, class};
use crate::plugin::effect::On;

/// The kind of an addition that is another model in place of the study's.
pub const MODEL_SWAP: &str = "model_swap";

/// Another model against the study's, neither with effects that were found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OtherModel {
    /// What the study calls it.
    pub name: String,
    /// The log of the probability of the data with it over that with the study's model.
    pub log_odds: f64,
    /// The standard error of that.
    pub error: f64,
    /// Its calibrated parameters: name, unit, value and standard deviation by the normal approximation.
    pub parameters: Vec<Estimate>,
}

/// A search that began with another model than the study's.
pub struct Contestant {
    /// The model as an addition, whose probability and class are still open; its unknowns are the parameters that it
    /// shares with the study's model.
    pub swap: Addition,
    /// The log of the probability of the data with it and its effects, times the prior mass, over that with the study's
    /// model and its effects.
    pub log_odds: f64,
    /// What the search found with it.
    pub account: Account,
    /// The share of the excess misfit of the study's model that closes.
    pub closed: f64,
    /// Whether that explains the gap, whatever a single place still says.
    pub explains: bool,
    /// What it foretells against the study's model with its effects.
    pub foretold: Vec<Foretelling>,
    /// The parameters of the study's model that it does not have: the medians and widths of their priors.
    pub idle: Vec<(String, f64, f64)>,
}

/// The account of the explanation that outweighs the others: that with the study's model, or with another.
pub fn settled(own: Account, others: Vec<Contestant>) -> Account {
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
    let best = others.into_iter().max_by(|a, b| a.log_odds.total_cmp(&b.log_odds));
    match best {
        Some(best) if best.log_odds > 0.0 => {
            let probability = share(best.log_odds);
            let class = class(&best.swap.name, probability, &shares);
            replaced(&own, best, probability, class)
        }
        _ => kept(own, share(0.0), &shares),
    }
}

/// The account with the study's model, where others may be as good.
fn kept(mut own: Account, probability: f64, shares: &[(String, f64)]) -> Account {
    let Some(first) = own.additions.first_mut() else { return own };
    let with = class(&first.kind, probability, shares);
    first.probability *= probability;
    first.class.extend(with.into_iter().skip(1));
    own.verdict.effects[0].probability = first.probability;
    own.verdict.effects[0].class.clone_from(&first.class);
    if own.verdict.word == Word::Named && first.class.len() > 1 {
        own.verdict.word = Word::Class;
    }
    own
}

/// The account with another model in place of the study's.
fn replaced(own: &Account, best: Contestant, probability: f64, class: Vec<String>) -> Account {
    let Contestant { swap, log_odds, account: mut other, closed, explains, foretold, idle } = best;
    let swap = Addition { class, probability, ..swap };
    let verdict = &mut other.verdict;
    verdict.closed = closed;
    verdict.effects.insert(0, named(&swap));
    let adequate = match verdict.word {
        Word::None | Word::NotVisible => true,
        Word::Unlisted if explains => {
            verdict.reasons.push(
                "a place still disagrees with the other model, though the misfit as a whole is that of noise"
                    .into(),
            );
            true
        }
        _ => false,
    };
    if adequate {
        verdict.word = Word::Named;
    }
    if verdict.word == Word::Named && swap.class.len() > 1 {
        verdict.word = Word::Class;
    }
    if adequate && swap.class.len() == 1 && probability < SURE {
        verdict.word = Word::Unlisted;
        verdict.reasons.push(format!(
            "the model `{}` explains the data, and not clearly better than the study's",
            swap.name
        ));
    }
    let passed = Passed {
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
    (other.insight.against, other.insight.foretold) = (Some(against), foretold);
    if other.verdict.word != Word::Unlisted {
        other.insight.places.clear();
        (other.insight.stopgap, other.insight.symbolic) = (None, None);
    }
    withhold(&mut other.verdict, &other.insight);
    other.additions[0].class.clone_from(&other.verdict.effects[0].class);
    other.models.clone_from(&own.models);
    other
}

fn named(swap: &Addition) -> Named {
    Named {
        name: swap.name.clone(),
        kind: swap.kind.clone(),
        on: On::new(),
        values: swap.unknowns.iter().map(|unknown| unknown.value).collect(),
        sd: swap.unknowns.iter().map(|unknown| unknown.sd).collect(),
        probability: swap.probability,
        class: swap.class.clone(),
    }
}

/// The parameters of the study's model, after the swap as the other model has them; of those that it lacks nothing is known
/// but the prior.
fn shifts(own: &Account, other: &[Shift], idle: &[(String, f64, f64)]) -> Vec<Shift> {
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
