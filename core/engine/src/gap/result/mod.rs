//! The result of the gap workflow as plain data: for the report, for scripts, and for the study that is written.

pub mod added;
mod addition;
mod alike;
pub mod companion;
mod curve;
pub mod insight;
pub mod law;
pub mod members;
pub mod names;
pub mod remains;
pub mod replaced;

use lacuna::data::Unit;
use lacuna::math::random::Stream;
use lacuna::plugin::effect::On;
use serde::{Deserialize, Serialize};

use self::added::Augmented;
use self::addition::additions;
use crate::gap::candidates::{Candidate, Placement, Untried};
use crate::gap::experiment::Experiment;
use crate::gap::experiment::hold_out::HeldOutKind;
use crate::gap::prove::Proof;
use crate::gap::result::companion::IdentifiedCompanion;
use crate::gap::result::insight::{Insight, insight, withhold};
use crate::gap::result::law::Law;
use crate::gap::result::members::{Member, members};
use crate::gap::result::names::NameProof;
use crate::gap::result::remains::{Remains, remains};
use crate::gap::result::replaced::OtherModel;
use crate::gap::search::needless::Needless;
use crate::gap::search::{
    Detectability, Diagnostics, Reliability, SearchOptions, SearchResult, SearchStep, Verdict,
    verdict,
};
use crate::gap::system::fit::precision;
use crate::gap::test::Region;

pub use addition::{AddedEffect, Estimate, IN_COMPANION, IN_RUNS};
pub use curve::CurveResult;

/// A search and what was found after it, as reports show it.
#[derive(Debug, Clone, PartialEq)]
pub struct GapFindings {
    /// The result of the search.
    pub result: GapResult,
    /// The hash of the files that hold it.
    pub hash: String,
    /// The result of the study with the effects, if it was run.
    pub added: Option<Augmented>,
}

impl GapFindings {
    /// The proof on held-out data: by the study with the effects if it was run, otherwise by the search.
    pub fn held_out(&self) -> &[HeldOut] {
        match &self.added {
            Some(added) if !added.held_out.is_empty() => &added.held_out,
            _ => &self.result.held_out,
        }
    }

    /// The proof of the names; `None` if no effect was found.
    pub fn proof(&self) -> Option<NameProof> {
        NameProof::of(&self.result, self.held_out())
    }
}

/// The whole result of the gap workflow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GapResult {
    /// The verdict with its reasons.
    pub verdict: Verdict,
    /// The probabilities of a false alarm by the scores, and by scan and energy.
    pub levels: [f64; 2],
    /// The number of simulations of the null distributions: p-values are not below `1 / (simulations + 1)`.
    #[serde(default)]
    pub simulations: usize,
    /// True if the noise of some curve is assumed because it has no replicates.
    pub noise_assumed: bool,
    /// The effects that were found, as a study would add them.
    pub additions: Vec<AddedEffect>,
    /// The members of the class, if the verdict is one; the effects above are one of them.
    #[serde(default)]
    pub members: Vec<Member>,
    /// The effects that were not tried.
    #[serde(default)]
    pub untried: Vec<Untried>,
    /// The steps that led to them.
    pub path: Vec<StepResult>,
    /// The p-values of the largest score, the best cell of the scan and the energy: without the effects and with them.
    pub p: [[f64; 3]; 2],
    /// The regions in which data and model disagree, without the effects and with them.
    pub regions: [Vec<RegionResult>; 2],
    /// The detectability of each placement.
    pub visible: Vec<Detectability>,
    /// The name and unit of the size of each type.
    pub sizes: Vec<Size>,
    /// The calibrated unknowns without the effects and with them.
    pub parameters: Vec<Shift>,
    /// The curves in the order of their outputs.
    pub curves: Vec<CurveResult>,
    /// The mean of the replicates that were not held out, one an output, in the response's unit.
    pub means: Vec<f64>,
    /// The number of those replicates at each output.
    pub counts: Vec<f64>,
    /// The standard deviation of one replicate at each output, in the response's unit.
    pub sd: Vec<f64>,
    /// The calibrated response at each output, in its unit: without the effects and with them.
    pub response: [Vec<f64>; 2],
    /// The residual at each output, whitened and projected off the slopes of the unknowns, in standard deviations of
    /// the mean: without the effects and with them.
    pub left: [Vec<f64>; 2],
    /// The part of the gap that the effects leave; `None` if nothing shows.
    #[serde(default)]
    pub remains: Option<Remains>,
    /// The companion with its constants; `None` if the study has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub companion: Option<IdentifiedCompanion>,
    /// The missing rate of the equations and its law; `None` if it was not sought or nothing was found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<Law>,
    /// The insight besides the verdict.
    pub insight: Insight,
    /// The proof on held-out data, by kind.
    pub held_out: Vec<HeldOut>,
    /// Other models in place of the study's, each after its own calibration.
    #[serde(default)]
    pub models: Vec<OtherModel>,
    /// The terms and effects of the study that are not needed beside those that were found.
    #[serde(default)]
    pub needless: Vec<Needless>,
    /// The count in simulated cases of the study itself by which the probabilities are corrected, if there is one.
    #[serde(skip)]
    pub reliability: Option<Reliability>,
}

/// The p-value of the energy above which there is no significant excess misfit that effects could explain.
const EXCESS: f64 = 0.05;

/// The size of a type of effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Size {
    /// The type.
    pub kind: String,
    /// The size's name.
    pub name: String,
    /// The unit.
    pub unit: Unit,
}

/// A calibrated unknown without and with the effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shift {
    /// The name.
    pub name: String,
    /// The unit.
    pub unit: Unit,
    /// The values.
    pub value: [f64; 2],
    /// The standard deviations by the normal approximation.
    pub sd: [f64; 2],
    /// The standard deviation of its prior, or of a normal distribution as wide.
    pub prior_sd: f64,
    /// True if it lies at an end of its prior's support.
    pub at_bound: [bool; 2],
}

/// A step of the path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepResult {
    /// The probabilities before it, as in [`GapResult::p`].
    pub p: [f64; 3],
    /// The placements that were refitted, the one of largest weight first.
    pub leaders: Vec<WeighedPlacement>,
    /// The log posterior odds of any of them against no further effect.
    pub log_odds: f64,
    /// The placements that were added: types and labels.
    pub added: Vec<(String, On)>,
    /// The names of effects that were dropped after it.
    pub dropped: Vec<String>,
}

/// An effect that was weighed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WeighedPlacement {
    /// The name of its plugin.
    pub kind: String,
    /// The labels on which it acts, by axis; empty for all.
    pub on: On,
    /// The log evidence plus log prior mass, less the largest of the step.
    pub log_weight: f64,
    /// The largest studentised score.
    pub score: f64,
    /// The share of its squared whitened length that the calibrated unknowns absorb.
    pub absorbed: f64,
}

/// A region of the response in which data and model disagree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegionResult {
    /// The curves, by their index in [`GapResult::curves`].
    pub curves: Vec<usize>,
    /// The first and the last coordinate on the last axis, in its unit.
    pub span: (f64, f64),
    /// The band of frequencies in which they disagree, in the inverse unit of the last axis; `None` for all.
    pub band: Option<(f64, f64)>,
    /// The familywise p-value.
    pub p: f64,
}

/// The proof with one kind of held-out data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// The kind of the held-out data.
    pub kind: HeldOutKind,
    /// Names of the held-out parts.
    pub names: Vec<String>,
    /// The proof.
    pub proof: Proof,
    /// The accuracy without and with the effects: the share of outputs inside the held-out replicates' 95 % interval,
    /// on the mean over the groups (Radaideh et al., arXiv 2202.03959); `None` without two replicates.
    pub accuracy: Option<[f64; 2]>,
}

impl GapResult {
    /// The share of the excess misfit, from 0 to 1, that the effects explain in the data of the search; `None` if there
    /// is no effect, or if the energy of the residual is that of noise.
    pub fn explained(&self) -> Option<f64> {
        let has_share = !self.additions.is_empty() && self.p[0][2] <= EXCESS;
        has_share.then(|| self.verdict.closed.clamp(0.0, 1.0))
    }

    /// The result with the probabilities corrected by a count in simulated cases of the study itself.
    pub fn corrected(mut self, reliability: Reliability) -> Self {
        let mut least: Option<f64> = None;
        for (i, effect) in self.verdict.effects.iter_mut().enumerate() {
            let Some(traits) = &effect.traits else { continue };
            let before = traits.probability();
            let after = reliability.corrected(before);
            effect.probability *= after / before;
            least = Some(least.map_or(after, |least| least.min(after)));
            if let Some(addition) = self.additions.get_mut(i) {
                addition.probability = effect.probability;
            }
        }
        self.verdict.none_of_these = least.map(|least| 1.0 - least).or(self.verdict.none_of_these);
        self.reliability = Some(reliability);
        self
    }

    /// The result of a search, without the proof.
    pub fn of<'a>(
        found: &SearchResult<'a>,
        candidates: &'a [Candidate],
        options: SearchOptions,
        stream: &Stream,
    ) -> Self {
        let first = found.first();
        let both = [first, &found.last];
        let experiment = found.system.experiment;
        let mut verdict = verdict(found, candidates, options);
        let insight = insight(found, candidates, &verdict, stream);
        withhold(&mut verdict, &insight);
        verdict.reasons.extend(alike::opposites(found, candidates));
        let additions = additions(found, candidates, &verdict);
        let (counts, _) = experiment.means();
        Self {
            levels: [options.naming, options.unlisted],
            simulations: options.simulations,
            noise_assumed: found.noise.is_assumed(),
            members: members(found, candidates, &verdict, &additions),
            additions,
            untried: Vec::new(),
            path: found.path.iter().map(|step| passed(step, candidates)).collect(),
            p: both.map(|diagnostics| diagnostics.p),
            regions: both.map(|diagnostics| spots(experiment, &diagnostics.regions)),
            visible: first.visible.clone(),
            sizes: sizes(experiment, candidates),
            parameters: shifts(experiment, both),
            curves: curve::all(found),
            means: found.means.clone(),
            counts,
            sd: found.noise.sd(experiment, &found.last.fit.at.response),
            response: both.map(|diagnostics| diagnostics.fit.at.response.clone()),
            left: both.map(|diagnostics| diagnostics.statistics.residual.clone()),
            remains: remains(found),
            companion: None,
            law: None,
            insight,
            held_out: Vec::new(),
            models: Vec::new(),
            needless: Vec::new(),
            reliability: None,
            verdict,
        }
    }
}

fn passed(step: &SearchStep, candidates: &[Candidate]) -> StepResult {
    let kind = |placement: &Placement| candidates[placement.candidate].kind.clone();
    let best = step.weighed.first().map_or(0.0, |j| j.log_weight);
    StepResult {
        p: step.before.p,
        log_odds: step.log_odds,
        leaders: step
            .weighed
            .iter()
            .map(|j| WeighedPlacement {
                kind: kind(&j.placement),
                on: j.placement.on.clone(),
                log_weight: j.log_weight - best,
                score: j.score,
                absorbed: j.absorbed,
            })
            .collect(),
        added: step.added.iter().map(|s| (kind(s), s.on.clone())).collect(),
        dropped: step.dropped.clone(),
    }
}

fn spots(experiment: &Experiment<'_>, regions: &[Region]) -> Vec<RegionResult> {
    let spot = |region: &Region| {
        let at = &experiment.curves[region.curves[0]].at;
        // Cosine k of a curve of n even steps has the frequency k / (2 n step).
        let band = region.cell.band.filter(|_| at.len() > 1).map(|(begin, end)| {
            let step = (at[at.len() - 1] - at[0]) / (at.len() - 1) as f64;
            let frequency = |k: usize| k as f64 / (2.0 * at.len() as f64 * step);
            (frequency(begin), frequency(end))
        });
        RegionResult { curves: region.curves.clone(), span: region.span, band, p: region.p }
    };
    regions.iter().map(spot).collect()
}

fn sizes(experiment: &Experiment<'_>, candidates: &[Candidate]) -> Vec<Size> {
    let mut sizes: Vec<Size> = Vec::new();
    for candidate in candidates {
        let unknowns = candidate.effect.parameters(&experiment.layouts.blocks[0]);
        if let Some(size) = unknowns.into_iter().next()
            && !sizes.iter().any(|other| other.kind == candidate.kind)
        {
            sizes.push(Size { kind: candidate.kind.clone(), name: size.name, unit: size.unit });
        }
    }
    sizes
}

fn shifts(experiment: &Experiment<'_>, both: [&Diagnostics; 2]) -> Vec<Shift> {
    let sd = both.map(|diagnostics| diagnostics.fit.sd());
    let shift = |(j, parameter): (usize, &lacuna::data::Parameter)| {
        let value = both.map(|diagnostics| diagnostics.fit.at.point[j]);
        let (low, high) = parameter.prior.support();
        let prior_sd = 1.0 / precision(&parameter.prior).sqrt();
        let near = 1e-3 * prior_sd;
        Shift {
            name: parameter.name.clone(),
            unit: parameter.unit.clone(),
            value,
            sd: [sd[0][j], sd[1][j]],
            prior_sd,
            at_bound: value.map(|x| x - low < near || high - x < near),
        }
    };
    experiment.parameters.iter().enumerate().map(shift).collect()
}
