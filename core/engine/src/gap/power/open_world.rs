//! Right and wrong answers, in the library and outside of it.
//!
//! A plant of the library is named rightly by its type, alone or in a class. A plant of another form has no exact name:
//! `unlisted` is right, and so is `approximate` or `class` with the types that come nearest to it, where they explain most
//! of it; the word `named` is right only where the data cannot show that the form is another one. A plant that no type
//! comes near to, such as every term of the grammar, is rightly called `unlisted` alone.

use serde::{Deserialize, Serialize};

use super::inject::Outside;
use super::{ABSORBED, CaseOutcome, NamedInCase};
use crate::gap::search::{Told, Traits, VerdictKind};

/// The squared length, in squared standard deviations, from which on the data show that a form is another one: three
/// standard deviations along it.
const SEEN: f64 = 9.0;

/// The answers to changes of one kind outside the library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutsideRates {
    /// The kind.
    pub kind: String,
    /// The sort of the kind.
    pub sort: String,
    /// The number of cases.
    pub cases: usize,
    /// The number of cases that no test noticed.
    pub unnoticed: usize,
    /// The number of cases that were rightly called `unlisted`.
    pub unlisted: usize,
    /// The number of cases that were rightly compared with the nearest type.
    pub nearest: usize,
    /// The number of cases with another name that is wrong.
    pub wrong: usize,
    /// The number of those whose verdict is `named`.
    pub named: usize,
}

/// The answers by kind, in the order of the kinds.
pub(super) fn outside(outcomes: &[CaseOutcome]) -> Vec<OutsideRates> {
    let mut all: Vec<OutsideRates> = Vec::new();
    let mut planted: Vec<(&Outside, &CaseOutcome)> =
        outcomes.iter().filter_map(|o| Some((o.planted.outside.as_ref()?, o))).collect();
    planted.sort_by_key(|(outside, _)| outside.kind);
    for (outside, outcome) in planted {
        let (kind, sort) = (outside.kind.words(), outside.kind.sort());
        if all.last().is_none_or(|last| last.kind != kind) {
            let (kind, sort) = (kind.to_owned(), sort.to_owned());
            let empty = OutsideRates {
                kind,
                sort,
                cases: 0,
                unnoticed: 0,
                unlisted: 0,
                nearest: 0,
                wrong: 0,
                named: 0,
            };
            all.push(empty);
        }
        let Some(own) = all.last_mut() else { continue };
        own.cases += 1;
        let right = is_right(outside, outcome);
        match outcome.word {
            VerdictKind::None | VerdictKind::NotVisible => own.unnoticed += 1,
            VerdictKind::Unlisted => own.unlisted += 1,
            _ if right => own.nearest += 1,
            word => {
                own.wrong += 1;
                own.named += usize::from(word == VerdictKind::Named);
            }
        }
    }
    all
}

/// True when the verdict on a noticed change is right.
fn is_right(outside: &Outside, outcome: &CaseOutcome) -> bool {
    let near = |said: &NamedInCase| is_near(outside, outcome.word, said);
    outcome.word == VerdictKind::Unlisted
        || !outcome.effects.is_empty() && outcome.effects.iter().all(near)
}

/// True when a name that was given with this word is that of a type near to the change.
fn is_near(outside: &Outside, word: VerdictKind, said: &NamedInCase) -> bool {
    let is_exact = word == VerdictKind::Named && outside.nearest.left > SEEN;
    !is_exact && outside.nearest.types.iter().any(|kind| said.class.contains(kind))
}

/// The probabilities of all effects that were found, with their outcomes: half of the weight for plants of the library,
/// half for those of another form, as if both were equally probable before the data. Plants that the parameters absorb
/// count for neither, nor do bumps and cases without a plant.
pub fn told(outcomes: &[CaseOutcome], by: &dyn Fn(&Traits) -> f64) -> Vec<Told> {
    let is_visible = |o: &&CaseOutcome| o.absorbed <= ABSORBED;
    let planted = |is_outside: bool| {
        let own = outcomes.iter().filter(is_visible).filter(move |o| {
            o.planted.outside.is_some() == is_outside
                && (is_outside || !o.planted.effects.is_empty())
        });
        own.collect::<Vec<&CaseOutcome>>()
    };
    let parts = [planted(false), planted(true)];
    let whole = parts.iter().map(Vec::len).sum::<usize>() as f64;
    let filled = parts.iter().filter(|own| !own.is_empty()).count() as f64;
    let mut all = Vec::new();
    for own in &parts {
        let weight = whole / (filled * own.len().max(1) as f64);
        for outcome in own {
            for said in &outcome.effects {
                let Some(traits) = &said.traits else { continue };
                let right = match &outcome.planted.outside {
                    Some(outside) => is_near(outside, outcome.word, said),
                    None => {
                        outcome.planted.effects.iter().any(|(kind, ..)| said.class.contains(kind))
                    }
                };
                all.push(Told { probability: by(traits), right, weight });
            }
        }
    }
    all
}
