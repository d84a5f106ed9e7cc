//! The hypotheses of what is missing: the types that a search weighed in the place of its least certain effect.

use lacuna::plugin::discrepancy::CommonError;

use crate::gap::candidates::{Candidate, Placement};
use crate::gap::search::{Explanation, SearchResult, Weighed};
use crate::gap::system::System;
use crate::gap::system::fit::Fit;

/// The smallest share of the posterior probability with which a type is a hypothesis of what is missing.
const POSSIBLE: f64 = 1e-3;

/// The name of the model without effects.
const NOTHING: &str = "nothing";

/// A hypothesis with its fit to the data.
pub(super) struct Possible<'a> {
    /// The type of the effect that is in question.
    pub kind: String,
    /// The posterior probability of the type.
    pub weight: f64,
    system: System<'a>,
    fit: Fit,
    remainder: Option<CommonError>,
}

impl<'a> Possible<'a> {
    fn of(found: &SearchResult<'a>, kind: &str, weight: f64, system: System<'a>, fit: Fit) -> Self {
        let outputs = system.experiment.outputs() as f64;
        let white = found.remainder.white(&found.whitener);
        let setting = white.evidences(&fit).and_then(|all| all.best());
        let remainder = setting.map(|setting| found.remainder.common(setting, outputs));
        Self { kind: kind.to_owned(), weight, system, fit, remainder }
    }

    /// The explanation with the remainder that it leaves.
    pub fn explanation(&self) -> Explanation<'a, '_> {
        Explanation { system: &self.system, fit: &self.fit, remainder: self.remainder.as_ref() }
    }
}

/// The hypotheses after a search. The type of one effect is in question, the least certain one; the others are there in
/// every hypothesis. What the search found is the only hypothesis if no other type is possible.
pub(super) fn possible<'a>(
    found: &SearchResult<'a>,
    candidates: &'a [Candidate],
) -> Vec<Possible<'a>> {
    let doubt = |types: &[(String, f64)]| types.iter().map(|(_, p)| p * (1.0 - p)).sum::<f64>();
    let slots = (0..found.slots.len())
        .max_by(|a, b| doubt(&found.types[*a]).total_cmp(&doubt(&found.types[*b])).then(b.cmp(a)));
    let mut all = slots.map_or_else(Vec::new, |slot| of_slot(found, candidates, slot));
    if all.len() < 2 {
        let kinds: Vec<&str> =
            found.chosen.iter().map(|own| candidates[own.candidate].kind.as_str()).collect();
        let kind = if kinds.is_empty() { NOTHING.to_owned() } else { kinds.join(" and ") };
        let (system, fit) = (found.system.clone(), found.last.fit.clone());
        all = vec![Possible::of(found, &kind, 1.0, system, fit)];
    }
    all
}

/// The best placement of each possible type in the place of one effect.
fn of_slot<'a>(
    found: &SearchResult<'a>,
    candidates: &'a [Candidate],
    slot: usize,
) -> Vec<Possible<'a>> {
    let mut all: Vec<Possible<'a>> = Vec::new();
    for weighed in &found.slots[slot] {
        let kind = &candidates[weighed.placement.candidate].kind;
        let share = found.types[slot].iter().find(|(own, _)| own == kind).map_or(0.0, |(_, p)| *p);
        let is_known = all.iter().any(|own| own.kind == *kind);
        if share >= POSSIBLE && !is_known {
            let system = exchanged(found, candidates, slot, weighed);
            all.push(Possible::of(found, kind, share, system, weighed.fit.clone()));
        }
    }
    all
}

/// The system in which a placement, the last of its effects, is in the place of one effect.
fn exchanged<'a>(
    found: &SearchResult<'a>,
    candidates: &'a [Candidate],
    slot: usize,
    weighed: &Weighed,
) -> System<'a> {
    let experiment = found.system.experiment;
    let others = found.chosen.iter().enumerate().filter(|(i, _)| *i != slot);
    let all = others.map(|(_, own)| own).chain([&weighed.placement]);
    let placed =
        |own: &Placement| own.placed(experiment, candidates, &candidates[own.candidate].kind);
    System::new(experiment, all.map(placed).collect())
}
