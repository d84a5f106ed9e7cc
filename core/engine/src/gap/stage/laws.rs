//! The law of a missing rate: sought where no candidate has a name, proven on data that were held out, and searched for
//! again among the candidates.

use lacuna::data::Observations;
use lacuna::run::Stop;

use super::counted::counted;
use super::models::{ModelSearch, own_pieces};
use super::prepared::{PreparedSearch, prepared};
use super::search_model::SearchModel;
use crate::gap::experiment::hold_out::{HeldOutData, HeldOutKind};
use crate::gap::experiment::transient::without;
use crate::gap::inside::{InsideCandidates, Pieces, extended};
use crate::gap::law::apart::{Apart, apart, compared};
use crate::gap::law::{Described, LawSetting, find, pieces};
use crate::gap::result::GapResult;
use crate::gap::result::law::{Law, LawProof, LawTerm};
use crate::gap::search::needless::needless;
use crate::gap::search::{SearchResult, VerdictKind};
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

/// The smallest share of what a free force explains that a law explains.
const MOST: f64 = 0.8;

/// The smallest share of random halves of the data in which each form of a law is chosen (Meinshausen and Bühlmann, Journal of
/// the Royal Statistical Society B 72 (2010) 417).
const STABLE: f64 = 0.6;

/// The log score by which a free force may predict held-out data better than a law: 20 to 1.
const WORSE: f64 = 3.0;

/// The outcome of the search for a law.
pub enum Sought {
    /// The result with the law among its effects.
    Accepted(Box<GapResult>),
    /// A description of the missing rate.
    Described(Box<Law>),
}

/// True if a study has equations to which a law could be added: no surrogate in their place, no effect on their response.
fn has_equations(study: &Study, problem: &InverseProblem<'_>) -> bool {
    let amends = study.model.as_ref().is_some_and(|model| model.built.plugin.amend().is_some());
    let alone = problem.emulator().is_none() && study.placed_effects().is_empty();
    amends && alone && study.surrogate.is_none() && study.gap.companion.is_none()
}

/// The share of the gap that names close if they need no law beside them: what they leave may be an error of their own form.
const ENOUGH: f64 = 0.95;

/// True if a result leaves something without a name.
fn is_open(result: &GapResult) -> bool {
    let verdict = &result.verdict;
    match verdict.word {
        VerdictKind::Unlisted => true,
        VerdictKind::None => result.remains.is_some(),
        VerdictKind::Approximate | VerdictKind::Class => {
            result.remains.is_some() && verdict.closed < ENOUGH
        }
        VerdictKind::Named | VerdictKind::NotVisible => false,
    }
}

impl PreparedSearch<'_> {
    /// The held-out data of other conditions, curves or places than those of the search.
    fn elsewhere(&self) -> Option<&HeldOutData> {
        self.split.held_out.iter().find(|part| part.kind != HeldOutKind::Replicates)
    }

    /// The proof of a law on held-out data; `all` are all measurements.
    fn proof_of_law(
        &self,
        part: &HeldOutData,
        all: &Observations,
        described: &Described,
    ) -> Result<Option<LawProof>, Stop> {
        let all = &without(all, &self.transients);
        let held_out = self.base.experiment(&part.data, &described.parameters)?;
        let whole = self.base.experiment(all, &described.parameters)?;
        Ok(compared(&held_out, &whole, described, (part.kind, &part.names)))
    }
}

impl ModelSearch<'_> {
    /// The law of what a search left without a name; `None` if it is not sought or no rate lacks a force.
    pub(super) fn law(
        &self,
        own: &PreparedSearch<'_>,
        found: &SearchResult<'_>,
        result: &GapResult,
    ) -> Result<Option<Sought>, Stop> {
        let Self { study, problem, measured, .. } = *self;
        if !study.gap.keys.laws || !is_open(result) || !has_equations(study, problem) {
            return Ok(None);
        }
        let stream = own.random.named("law");
        let elsewhere = own.elsewhere();
        let parts: Option<Apart<'_>> = match elsewhere {
            Some(_) => None,
            None => apart(own.experiment, &stream.named("apart")),
        };
        let experiment = parts.as_ref().map_or(own.experiment, |parts| &parts.training);
        let noise = found.noise.restricted(own.experiment, experiment);
        let setting =
            LawSetting { study, experiment, noise: &noise, starts: &own.starts, stream: &stream };
        let Some(described) = find(&setting) else { return Ok(None) };
        let proof = match (elsewhere, &parts) {
            (Some(part), _) => own.proof_of_law(part, &measured.used, &described)?,
            (None, Some(parts)) => parts.proof(own.experiment, &described),
            (None, None) => None,
        };
        let Described { mut law, .. } = described;
        law.reason = doubt(&law, proof.as_ref());
        law.proof = proof;
        if law.reason.is_some() {
            return Ok(Some(Sought::Described(Box::new(law))));
        }
        self.searched(own, found, result, law).map(Some)
    }

    /// The search with the terms of a law among the candidates, beside the effects that were found without it.
    fn searched(
        &self,
        own: &PreparedSearch<'_>,
        found: &SearchResult<'_>,
        result: &GapResult,
        mut law: Law,
    ) -> Result<Sought, Stop> {
        let Self { study, problem, measured, .. } = self;
        let all = law.candidates();
        let names: Vec<String> = all.iter().map(|term| term.name.clone()).collect();
        let kept = result.additions.iter().flat_map(|a| a.class.iter().chain([&a.kind]).cloned());
        let only: Vec<String> = names.iter().cloned().chain(kept).collect();
        let Some(pieces) = Pieces::with(study, pieces(&all))? else {
            law.reason = Some("the model with it cannot be made".to_owned());
            return Ok(Sought::Described(Box::new(law)));
        };
        let mut candidates = pieces.candidates();
        for candidate in candidates.iter_mut().filter(|own| names.contains(&own.kind)) {
            candidate.beside.clone_from(&law.parameters);
        }
        let inside = InsideCandidates {
            candidates,
            wide: Some(counted(extended(study, &pieces)?, self.progress)),
            ..InsideCandidates::default()
        };
        let beginning = SearchModel {
            forward: self.forward,
            only: Some(&only),
            ..SearchModel::own(study, problem, &inside)
        };
        let random = own.random.named("law").named("search");
        prepared(study, problem, &beginning, &random, |with| {
            let again = with.search(&|_| {})?;
            let before = &found.first().fit.at.response;
            let mut all = with.result(&again, before, &measured.used)?;
            let added = all.worth_adding();
            let kinds: Vec<&str> = added.iter().map(|addition| addition.kind.as_str()).collect();
            let exact = matches!(all.verdict.word, VerdictKind::Named | VerdictKind::Class);
            if !exact || !law.is_kept_in(&kinds) {
                law.reason = Some(not_kept(&all));
                return Ok(Sought::Described(Box::new(law)));
            }
            all.models = self.compared(with, &again);
            all.needless = needless(&again, &own_pieces(study), &with.random);
            all.untried.clone_from(&result.untried);
            for addition in &all.additions {
                let own = law.terms.iter_mut().find(|term| term.name == addition.kind);
                if let Some(term) = own {
                    calibrated(term, addition);
                }
            }
            law.accepted = true;
            all.law = Some(law);
            all.verdict.reasons.extend(all.not_added());
            Ok(Sought::Accepted(Box::new(all)))
        })
    }
}

/// Sets the unknowns of a term to those of the effect that was found.
fn calibrated(term: &mut LawTerm, addition: &crate::gap::result::AddedEffect) {
    let unknowns = std::iter::once(&mut term.coefficient).chain(&mut term.index);
    for (unknown, found) in unknowns.zip(&addition.unknowns) {
        (unknown.value, unknown.sd) = (found.value, found.sd);
    }
}

/// The reason for which a law is none, in words; `None` if the data that were held out confirm it.
fn doubt(law: &Law, proof: Option<&LawProof>) -> Option<String> {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    if law.terms.is_empty() {
        return Some("no form of the dictionary is worth its price".to_owned());
    }
    if law.explained < MOST {
        let share = percent(law.explained);
        return Some(format!("it explains {share} of what a free force explains"));
    }
    if let Some(term) = law.terms.iter().find(|term| term.stability < STABLE) {
        return Some(format!(
            "its form is chosen in {} of random halves of the data",
            percent(term.stability)
        ));
    }
    let Some(proof) = proof else {
        return Some("no condition and no block of the curves could be held out".to_owned());
    };
    let held_out = proof.kind.words();
    if !proof.proof.shrank {
        return Some(format!("that it closes the gap on held-out {held_out} is not shown"));
    }
    (proof.against_force < -WORSE)
        .then(|| format!("a free force predicts the held-out {held_out} better"))
}

/// The reason for which a search did not keep a law, in words.
fn not_kept(result: &GapResult) -> String {
    let reason = match result.verdict.word {
        VerdictKind::Approximate => "a remainder is significant beside it".to_owned(),
        VerdictKind::Named | VerdictKind::Class => {
            "another candidate explains the data better, or only a part of it is needed".to_owned()
        }
        _ => result.verdict.reasons.first().cloned().unwrap_or_default(),
    };
    format!("the search with it among the candidates does not name it: {reason}")
}
