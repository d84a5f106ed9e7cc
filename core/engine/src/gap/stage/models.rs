//! The study's model and other models in its place: a search with each, and the one that explains most.

use lacuna::plugin::Forward;
use lacuna::plugin::effect::On;
use lacuna::run::{Observer, Progress, Stop};

use super::laws::Sought;
use super::prepared::{PreparedSearch, prepared};
use super::search_model::SearchModel;
use crate::gap::candidates::{Candidate, sensors};
use crate::gap::inside::InsideCandidates;
use crate::gap::inside::{AlternativeModel, ModelFits};
use crate::gap::result::replaced::{AlternativeSearch, MODEL_SWAP, OtherModel, settled};
use crate::gap::result::{AddedEffect, Estimate, GapResult};
use crate::gap::search::needless::{OwnPiece, needless};
use crate::gap::search::{
    Explanation, SearchResult, cross_validate, explains, kinds, placement_prior,
};
use crate::gap::system::fit::precision;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::read::Measured;
use crate::stage::simulator::Simulator;
use crate::stage::stream;
use crate::study::Study;
use crate::study::unknowns::Unknown;

/// A study with the other models that it names.
pub struct ModelSearch<'a> {
    /// The study.
    pub study: &'a Study,
    /// The data, the forward map and its errors.
    pub problem: &'a InverseProblem<'a>,
    /// The forward map of its model, whose evaluations are counted.
    pub forward: &'a dyn Forward,
    /// The candidates inside its model.
    pub inside: &'a InsideCandidates<'a>,
    /// Other models in place of its own.
    pub alternatives: &'a [AlternativeModel<'a>],
    /// The measurements.
    pub measured: &'a Measured,
    /// The evaluations so far.
    pub progress: &'a Progress<'a>,
}

impl ModelSearch<'_> {
    /// Searches and proves with the study's model; if data and model disagree, also with the other models that are more
    /// probable.
    pub fn result(&self, observer: &dyn Observer) -> Result<GapResult, Stop> {
        let Self { study, problem, forward, inside, alternatives, measured, .. } = *self;
        let beginning = SearchModel { forward, ..SearchModel::own(study, problem, inside) };
        let random = stream(study, "gap");
        prepared(study, problem, &beginning, &random, |own| {
            if own.candidates.is_empty() {
                observer.warn("no effect proposes itself for these data: only the tests are made");
            }
            let found = own.search(&|share| self.progress.estimate(share))?;
            let mut result = own.result(&found, &found.first().fit.at.response, &measured.used)?;
            result.models = self.compared(own, &found);
            result.needless = needless(&found, &own_pieces(study), &own.random);
            if !found.alarmed(own.options) {
                return Ok(result);
            }
            let explains_more = |alternative: &&AlternativeModel<'_>| {
                result.models.iter().any(|m| m.name == alternative.name && m.log_odds > 0.0)
            };
            let others: Vec<_> = alternatives.iter().filter(explains_more).collect();
            // Another model that explains more may have what the study's equations lack.
            let law = if others.is_empty() { self.law(own, &found, &result)? } else { None };
            match law {
                Some(Sought::Accepted(with)) => return Ok(*with),
                Some(Sought::Described(law)) => result.law = Some(*law),
                None => {}
            }
            let others: Result<Vec<AlternativeSearch>, Stop> = others
                .into_iter()
                .filter_map(|alternative| self.contest(alternative, own, &found).transpose())
                .collect();
            let mut result = settled(result, others?);
            result.verdict.reasons.extend(result.not_added());
            Ok(result)
        })
    }

    /// The comparison of other models with the study's, none with effects that were found; those that explain most
    /// first.
    pub(super) fn compared(
        &self,
        own: &PreparedSearch<'_>,
        found: &SearchResult<'_>,
    ) -> Vec<OtherModel> {
        let compare = |alternative: &AlternativeModel<'_>| {
            let stream = own.random.named("models").named(&alternative.name);
            let effects = self.study.placed_effects();
            alternative.compare(own.experiment, effects, &found.first().fit, &found.noise, &stream)
        };
        let mut models: Vec<OtherModel> = self.alternatives.iter().filter_map(compare).collect();
        models.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
        models
    }

    /// The search with another model; `None` if it has no response.
    fn contest(
        &self,
        alternative: &AlternativeModel<'_>,
        own: &PreparedSearch<'_>,
        found: &SearchResult<'_>,
    ) -> Result<Option<AlternativeSearch>, Stop> {
        let Self { study, problem, measured, .. } = self;
        let random = own.random.named("models").named(&alternative.name).named("search");
        let inside = InsideCandidates::default();
        let (forward, parameters) = (&*alternative.forward, &alternative.parameters[..]);
        let other = Some(&alternative.common[..]);
        let beginning =
            SearchModel { forward, parameters, region: None, inside: &inside, other, only: None };
        prepared(study, problem, &beginning, &random, |with| {
            let found_with = with.search(&|_| {})?;
            let side = |of: &SearchResult<'_>| vec![of.last.fit.at.point.clone()];
            let sides = [
                ModelFits { system: &found.system, starts: side(found) },
                ModelFits { system: &found_with.system, starts: side(&found_with) },
            ];
            let Some(odds) = alternative.bayes_factor(&sides, &found.noise, &random.named("odds"))
            else {
                return Ok(None);
            };
            // The other models share the prior mass of one type.
            let masses =
                (kinds(own.candidates) as f64).ln() + (self.alternatives.len() as f64).ln();
            let prior = log_prior(&found_with, with.candidates) - masses;
            let before = found.first();
            let result = with.result(&found_with, &before.fit.at.response, &measured.used)?;
            let closed = 1.0 - found_with.last.excess() / before.excess().max(f64::MIN_POSITIVE);
            let winner = Explanation::exact(&found_with.system, &found_with.last.fit);
            let second = Explanation::exact(&found.system, &found.last.fit);
            Ok(Some(AlternativeSearch {
                swap: addition(alternative, &found_with),
                log_odds: odds.log_odds + prior - log_prior(found, own.candidates),
                result,
                closed,
                explains: explains(closed, &found_with.last),
                cross_validation: cross_validate(
                    winner,
                    second,
                    &found.noise,
                    1 + self.alternatives.len(),
                ),
                idle: self.idle(alternative),
            }))
        })
    }

    /// The parameters that the other model lacks: the medians and the widths of their priors.
    fn idle(&self, alternative: &AlternativeModel<'_>) -> Vec<(String, f64, f64)> {
        let has = |name: &str| alternative.parameters.iter().any(|p| p.name == name);
        let idle = self.study.parameters.iter().filter(|p| !has(&p.name));
        idle.map(|p| (p.name.clone(), p.prior.quantile(0.5), precision(&p.prior).sqrt().recip()))
            .collect()
    }
}

/// The log prior mass of the effects that were found: of their types and of their places.
fn log_prior(found: &SearchResult<'_>, candidates: &[Candidate]) -> f64 {
    let sensors = sensors(found.system.experiment).len();
    let types = (kinds(candidates) as f64).ln();
    found.chosen.iter().map(|p| placement_prior(candidates, p, sensors) - types).sum()
}

/// The model as an addition, with the parameters that it shares with the study's.
fn addition(alternative: &AlternativeModel<'_>, found: &SearchResult<'_>) -> AddedEffect {
    let mut options =
        alternative.edit.swapped.as_ref().map(|swap| swap.model.clone()).unwrap_or_default();
    let plugin = options.remove("use").and_then(|used| Some(used.as_str()?.to_owned()));
    let fit = &found.last.fit;
    let estimates = alternative.parameters.iter().zip(&fit.at.point).zip(fit.sd());
    let unknowns = estimates.map(|((p, value), sd)| Estimate {
        name: p.name.clone(),
        unit: p.unit.clone(),
        value: *value,
        sd,
    });
    AddedEffect {
        name: alternative.name.clone(),
        kind: MODEL_SWAP.to_owned(),
        plugin: plugin.clone().unwrap_or_default(),
        title: format!("the model `{}` in place of the study's", alternative.name),
        formula: format!("[model] use = \"{}\"", plugin.unwrap_or_default()),
        on: On::new(),
        options,
        switches: Vec::new(),
        model: true,
        unknowns: unknowns.collect(),
        class: Vec::new(),
        probability: 0.0,
        posterior_probability: 0.0,
        share: 0.0,
        certain: false,
        rivals: Vec::new(),
    }
}

/// Range of the prior's distribution function at zero in which zero counts as a possible value of a coefficient.
const INSIDE: [f64; 2] = [1e-4, 1.0 - 1e-4];

/// The parameters that are coefficients of summands of rates and may be zero, and the study's effects.
pub fn own_pieces(study: &Study) -> Vec<OwnPiece> {
    let mut all: Vec<OwnPiece> = coefficients(study).unwrap_or_default();
    let mut begin = study.parameters.len();
    for effect in study.placed_effects() {
        let absent: Vec<(usize, f64)> =
            effect.absent().into_iter().enumerate().map(|(k, x)| (begin + k, x)).collect();
        begin += absent.len();
        all.push(OwnPiece { name: effect.name.clone(), absent });
    }
    all
}

fn coefficients(study: &Study) -> Option<Vec<OwnPiece>> {
    let simulator = Simulator::of(study).ok()??;
    let amend = simulator.model.amend()?;
    let (layout, _) = study.layouts.of_scenario(&study.scenarios.first()?.name)?;
    let factors = amend.factors(&study.context_of(&layout));
    let own = |(i, unknown): (usize, &Unknown)| {
        let prior = &study.parameters[i].prior;
        let (low, high) = prior.support();
        let below = prior.cdf(0.0);
        let may_be_zero = low == 0.0 || high == 0.0 || (INSIDE[0] < below && below < INSIDE[1]);
        // A parameter with a value per scenario stands for several unknowns.
        let alone = study.unknowns.iter().filter(|u| u.name == unknown.name).count() == 1;
        (may_be_zero && alone && factors.contains(&unknown.name))
            .then(|| OwnPiece { name: unknown.name.clone(), absent: vec![(i, 0.0)] })
    };
    Some(study.unknowns.iter().enumerate().filter_map(own).collect())
}
