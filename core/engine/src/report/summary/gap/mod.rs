//! The keys of the gap between the data and the model.

mod companion;
mod effect;
mod held_out;
mod insight;
mod law;
mod proof;

use schemars::JsonSchema;
use serde::Serialize;

use self::companion::Companion;
use self::effect::Effect;
use self::held_out::HeldOut;
use self::insight::Insight;
use self::law::Law;
use self::proof::{Averaged, Member, Proof};
use super::value::{ByName, Quantity};
use crate::gap::candidates::Untried;
use crate::gap::experiment::hold_out::HeldOutKind;
use crate::gap::result::added::Augmented;
use crate::gap::result::remains::Remains;
use crate::gap::result::{GapFindings, GapResult, HeldOut as Compared, RegionResult, Shift};
use crate::gap::search::VerdictKind;

/// Result of the gap search.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Gap {
    /// Verdict in a word.
    pub verdict: VerdictKind,
    /// Reasons of the verdict, in words.
    pub reasons: Vec<String>,
    /// True if the noise of some curve is assumed because it has no replicates.
    pub noise_assumed: bool,
    /// p-values of the tests for a gap, without effects.
    pub p: Tests,
    /// p-values of the tests for a gap, with the effects that were found.
    pub p_after: Tests,
    /// Effects that were found; another model in place of the study's own comes first.
    pub effects: Vec<Effect>,
    /// Probability that what is missing is of no type that is named: one minus the probability of the class of the least
    /// certain effect; `null` without effects.
    pub none_of_these: Option<f64>,
    /// Part of the gap that the effects leave; `null` if nothing shows.
    pub remains: Option<Remains>,
    /// Proof of the names on data that were not used; `null` if no effect was found.
    pub proof: Option<Proof>,
    /// Companion of the simulator, inside which candidates act; only if the study has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub companion: Option<Companion>,
    /// Effects that were not tried, with the reason.
    pub not_tried: Vec<Untried>,
    /// Types that the data cannot distinguish, if the verdict is `class`.
    pub class: Vec<String>,
    /// Members of the class, the most probable first; empty unless the verdict is `class`.
    pub members: Vec<Member>,
    /// Posteriors of the parameters and derived quantities, averaged over the members by their weights; only if the
    /// studies of the members were run.
    #[serde(skip_serializing_if = "ByName::is_empty")]
    #[schemars(extend("propertyNames" = { "title": "parameter" }))]
    pub averaged: ByName<Averaged>,
    /// Regions where data and model disagree, without effects.
    pub regions: Vec<Region>,
    /// Regions where data and model disagree, with the effects that were found.
    pub regions_after: Vec<Region>,
    /// Comparison with held-out data, with replicates or blocks if there are any: of the study with the effects if it
    /// was run, otherwise of the search. `null` if nothing was held out.
    pub held_out: Option<HeldOut>,
    /// Calibrated parameters without and with the effects, from the data that were not held out.
    #[schemars(extend("propertyNames" = { "title": "parameter" }))]
    pub parameters: ByName<Shifted>,
    /// Comparisons with other kinds of held-out data.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub held_out_further: Vec<HeldOut>,
    /// Other models in place of the study's own, each after its own calibration and without effects. The odds are the
    /// probability of the data under the model over that under the study's own model.
    #[serde(skip_serializing_if = "ByName::is_empty")]
    #[schemars(extend("propertyNames" = { "title": "model" }))]
    pub models: ByName<Odds>,
    /// Coefficients or effects of the study that are not needed beside the effects that were found. The odds are the
    /// probability of the data without the piece over that with it; their logarithm is above log 3.
    #[serde(skip_serializing_if = "ByName::is_empty")]
    #[schemars(extend("propertyNames" = { "title": "piece" }))]
    pub needless: ByName<Odds>,
    /// Missing rate of the model's equations, and its law; only if it was sought and found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<Law>,
    /// Further results of the search.
    pub insight: Insight,
    /// The keys that a run of the study with the effects adds.
    #[serde(flatten)]
    pub added: Option<Added>,
}

/// p-values of the three tests for a gap: probabilities of statistics at least as large if nothing is missing.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Tests {
    /// p-value of the largest studentised score of all candidates.
    pub score: f64,
    /// p-value of the best cell of the scan over curves, times and frequencies.
    pub scan: f64,
    /// p-value of the energy: the sum of squares of the whitened residuals.
    pub energy: f64,
}

/// Region where data and model disagree.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Region {
    /// Labels of the curves, such as sensors.
    pub sensors: Vec<String>,
    /// First and last place on the last axis, in its unit.
    pub time: [Quantity; 2],
    /// Band of frequencies, lower and upper end, in the inverse unit of the last axis; `null` for all frequencies.
    pub band: Option<[Quantity; 2]>,
    /// Probability of a false alarm anywhere in the data.
    pub p: f64,
    /// Scenario of the curves, if the study has scenarios.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
}

/// Calibrated parameter without and with the effects.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Shifted {
    /// Posterior without the effects.
    pub before: Estimate,
    /// Posterior with the effects.
    pub after: Estimate,
    /// Unit of the parameter.
    pub unit: String,
}

/// Normal approximation of a posterior at its maximum.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Estimate {
    /// Maximum of the posterior density.
    pub map: Quantity,
    /// Standard deviation of the normal approximation.
    pub sd: f64,
}

/// Odds between two explanations of the data.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Odds {
    /// Logarithm of the odds.
    pub log_odds: Quantity,
    /// Standard error of that logarithm.
    pub error: f64,
}

/// The keys that a run of the study with the effects adds.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Added {
    /// File of the study with the effects.
    pub study: String,
    /// Run directory of the study with the effects.
    pub run: String,
    /// Log evidence of both studies, if it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log_evidence: Option<BeforeAfter>,
}

/// Value of a quantity without and with the effects.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BeforeAfter {
    /// Value without the effects.
    pub before: Quantity,
    /// Value with the effects.
    pub after: Quantity,
}

impl Gap {
    pub fn of(gap: &GapFindings) -> Self {
        let result = &gap.result;
        let added = gap.added.as_ref();
        let [regions, regions_after] =
            result.regions.each_ref().map(|spots| regions(result, spots));
        let (held_out, held_out_further) = held_out(gap.held_out());
        let shifts = result.parameters.iter();
        let models = result.models.iter();
        let needless = result.needless.iter();
        let exact = result.is_exact();
        let runs = added.map(|added| &added.members[..]).unwrap_or_default();
        let averaged = added.iter().flat_map(|added| &added.averaged);
        Self {
            verdict: result.verdict.word,
            reasons: result.verdict.reasons.clone(),
            noise_assumed: result.noise_assumed,
            p: Tests::of(result.p[0]),
            p_after: Tests::of(result.p[1]),
            effects: result.additions.iter().map(|a| Effect::of(a, exact, added)).collect(),
            none_of_these: result.verdict.none_of_these,
            remains: result.remains.clone(),
            proof: gap.proof().as_ref().map(Proof::of),
            companion: result.companion.as_ref().map(Companion::of),
            not_tried: result.untried.clone(),
            class: class(result),
            members: result.members.iter().map(|m| Member::of(m, runs)).collect(),
            averaged: averaged.map(|a| (a.name.clone(), Averaged::of(a))).collect(),
            regions,
            regions_after,
            held_out,
            parameters: shifts.map(|shift| (shift.name.clone(), Shifted::of(shift))).collect(),
            held_out_further,
            models: models.map(|m| (m.name.clone(), Odds::of(m.log_odds, m.error))).collect(),
            needless: needless.map(|n| (n.name.clone(), Odds::of(n.log_odds, n.error))).collect(),
            law: result.law.as_ref().map(Law::of),
            insight: Insight::of(&result.insight),
            added: added.map(Added::of),
        }
    }
}

/// The comparison that is shown first, and the others.
fn held_out(all: &[Compared]) -> (Option<HeldOut>, Vec<HeldOut>) {
    let is_replicates =
        |part: &&Compared| matches!(part.kind, HeldOutKind::Replicates | HeldOutKind::Blocks);
    let first = all.iter().find(is_replicates).or(all.first());
    let others = all.iter().filter(|part| Some(*part) != first);
    (first.map(HeldOut::of), others.map(HeldOut::of).collect())
}

/// The types that cannot be distinguished, if the verdict is a class.
fn class(result: &GapResult) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    if result.verdict.word == VerdictKind::Class {
        for kind in result.additions.iter().flat_map(|addition| &addition.class) {
            if !all.contains(kind) {
                all.push(kind.clone());
            }
        }
    }
    all
}

fn regions(result: &GapResult, spots: &[RegionResult]) -> Vec<Region> {
    spots.iter().map(|spot| Region::of(result, spot)).collect()
}

impl Tests {
    fn of([score, scan, energy]: [f64; 3]) -> Self {
        Self { score, scan, energy }
    }
}

impl Region {
    fn of(result: &GapResult, spot: &RegionResult) -> Self {
        let curves = spot.curves.iter().map(|&s| &result.curves[s]);
        let mut sensors: Vec<String> = Vec::new();
        for (_, label) in curves.clone().flat_map(|curve| &curve.labels) {
            if !sensors.contains(label) {
                sensors.push(label.clone());
            }
        }
        let scenario = curves.clone().find_map(|curve| curve.scenario.clone());
        let pair = |(first, last): (f64, f64)| [Quantity(first), Quantity(last)];
        Self { sensors, time: pair(spot.span), band: spot.band.map(pair), p: spot.p, scenario }
    }
}

impl Shifted {
    fn of(shift: &Shift) -> Self {
        let side = |k: usize| Estimate { map: shift.value[k].into(), sd: shift.sd[k] };
        Self { before: side(0), after: side(1), unit: shift.unit.to_string() }
    }
}

impl Odds {
    fn of(log_odds: f64, error: f64) -> Self {
        Self { log_odds: log_odds.into(), error }
    }
}

impl Added {
    fn of(added: &Augmented) -> Self {
        Self {
            study: added.study.display().to_string(),
            run: added.run.display().to_string(),
            log_evidence: added.log_evidence.map(BeforeAfter::of),
        }
    }
}

impl BeforeAfter {
    fn of([before, after]: [f64; 2]) -> Self {
        Self { before: before.into(), after: after.into() }
    }
}
