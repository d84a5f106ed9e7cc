//! The study's model and others in its place: a search with each, and the one that explains most.

use super::own::own_pieces;
use super::search::{Beginning, Inside, Prepared, prepared};
use crate::gap::account::{Account, Addition, Estimate};
use crate::gap::candidates::{Candidate, sensors};
use crate::gap::fit::precision;
use crate::gap::name::{Desk, Found, Rival as Explanation, explains, foretell, kinds};
use crate::gap::needless::needless;
use crate::gap::replaced::{Contestant, MODEL_SWAP, OtherModel, settled};
use crate::plugin::effect::On;
use crate::run::{Observer, Stop};
use crate::stage::gap_model::{Rival, Side};
use crate::stage::read::Measured;
use crate::stage::{Known, stream};
use crate::study::Study;

/// A study with the other models that it names.
pub struct Models<'a> {
    /// The study.
    pub study: &'a Study,
    /// What is known of it.
    pub known: &'a Known<'a>,
    /// What may be missing inside its model.
    pub inside: &'a Inside<'a>,
    /// Other models in place of its own.
    pub rivals: &'a [Rival<'a>],
    /// Its measurements.
    pub measured: &'a Measured,
}

impl Models<'_> {
    /// Searches and proves, with the study's model and, where data and that disagree, with those that explain more.
    pub fn account(&self, observer: &dyn Observer) -> Result<Account, Stop> {
        let Self { study, known, inside, rivals, measured } = self;
        let beginning = Beginning::own(study, known, inside);
        let random = stream(study, "gap");
        prepared(study, known, &beginning, &random, |own| {
            if own.candidates.is_empty() {
                observer.warn("no effect proposes itself for these data: only the tests are made");
            }
            let found = own.search()?;
            let mut account =
                own.account(&found, &found.first().fit.at.response, &measured.used)?;
            account.models = self.compared(own, &found);
            account.needless = needless(&found, &own_pieces(study), &own.random);
            if !found.alarmed(own.options) {
                return Ok(account);
            }
            let explains_more = |rival: &&Rival<'_>| {
                account.models.iter().any(|m| m.name == rival.name && m.log_odds > 0.0)
            };
            let others = rivals.iter().filter(explains_more);
            let others: Result<Vec<Contestant>, Stop> =
                others.filter_map(|rival| self.contest(rival, own, &found).transpose()).collect();
            Ok(settled(account, others?))
        })
    }

    /// Other models against the study's, neither with effects that were found; those that explain most first.
    fn compared(&self, own: &Prepared<'_>, found: &Found<'_>) -> Vec<OtherModel> {
        let compare = |rival: &Rival<'_>| {
            let stream = own.random.named("models").named(&rival.name);
            let effects = self.study.placed_effects();
            rival.compare(own.experiment, effects, &found.first().fit, &found.noise, &stream)
        };
        let mut models: Vec<OtherModel> = self.rivals.iter().filter_map(compare).collect();
        models.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
        models
    }

    /// What the search says with another model; `None` where it has no answer.
    fn contest(
        &self,
        rival: &Rival<'_>,
        own: &Prepared<'_>,
        found: &Found<'_>,
    ) -> Result<Option<Contestant>, Stop> {
        let Self { study, known, measured, .. } = self;
        let random = own.random.named("models").named(&rival.name).named("search");
        let inside = Inside::default();
        let (forward, parameters) = (&*rival.forward, &rival.parameters[..]);
        let other = Some(&rival.common[..]);
        let beginning = Beginning { forward, parameters, region: None, inside: &inside, other };
        prepared(study, known, &beginning, &random, |with| {
            let found_with = with.search()?;
            let side = |of: &Found<'_>| vec![of.last.fit.at.point.clone()];
            let sides = [
                Side { system: &found.system, starts: side(found) },
                Side { system: &found_with.system, starts: side(&found_with) },
            ];
            let Some(odds) = rival.odds(&sides, &found.noise, &random.named("odds")) else {
                return Ok(None);
            };
            // The other models share the prior mass of one type.
            let masses = (kinds(own.candidates) as f64).ln() + (self.rivals.len() as f64).ln();
            let prior = log_prior(&found_with, with.candidates) - masses;
            let before = found.first();
            let account = with.account(&found_with, &before.fit.at.response, &measured.used)?;
            let closed = 1.0 - found_with.last.excess() / before.excess().max(f64::MIN_POSITIVE);
            let winner = Explanation { system: &found_with.system, fit: &found_with.last.fit };
            let second = Explanation { system: &found.system, fit: &found.last.fit };
            Ok(Some(Contestant {
                swap: addition(rival, &found_with),
                log_odds: odds.log_odds + prior - log_prior(found, own.candidates),
                account,
                closed,
                explains: explains(closed, &found_with.last),
                foretold: foretell(winner, second, &found.noise, 1 + self.rivals.len()),
                idle: self.idle(rival),
            }))
        })
    }

    /// The parameters that the other model lacks: the medians and the widths of their priors.
    fn idle(&self, rival: &Rival<'_>) -> Vec<(String, f64, f64)> {
        let has = |name: &str| rival.parameters.iter().any(|p| p.name == name);
        let idle = self.study.parameters.iter().filter(|p| !has(&p.name));
        idle.map(|p| (p.name.clone(), p.prior.quantile(0.5), precision(&p.prior).sqrt().recip()))
            .collect()
    }
}

/// The log prior mass of the effects that were found: of their types and of their places.
fn log_prior(found: &Found<'_>, candidates: &[Candidate]) -> f64 {
    let desk = Desk {
        system: &found.system,
        candidates,
        whitener: &found.whitener,
        means: &found.means,
        sensors: sensors(found.system.experiment).len(),
    };
    let types = (kinds(candidates) as f64).ln();
    found.chosen.iter().map(|suspect| desk.log_prior(suspect) - types).sum()
}

/// The model as an addition, with the parameters that it shares with the study's.
fn addition(rival: &Rival<'_>, found: &Found<'_>) -> Addition {
    let mut options =
        rival.edit.swapped.as_ref().map(|swap| swap.model.clone()).unwrap_or_default();
    let plugin = options.remove("use").and_then(|used| Some(used.as_str()?.to_owned()));
    let fit = &found.last.fit;
    let estimates = rival.parameters.iter().zip(&fit.at.point).zip(fit.sd());
    let unknowns = estimates.map(|((p, value), sd)| Estimate {
        name: p.name.clone(),
        unit: p.unit.clone(),
        value: *value,
        sd,
    });
    Addition {
        name: rival.name.clone(),
        kind: MODEL_SWAP.to_owned(),
        plugin: plugin.clone().unwrap_or_default(),
        title: format!("the model `{}` in place of the study's", rival.name),
        formula: format!("[model] use = \"{}\"", plugin.unwrap_or_default()),
        on: On::new(),
        options,
        switches: Vec::new(),
        model: true,
        unknowns: unknowns.collect(),
        class: Vec::new(),
        probability: 0.0,
    }
}
