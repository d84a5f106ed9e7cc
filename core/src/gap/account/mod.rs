//! What a search found, as plain data: for the report, for scripts, and for the study that is written.

mod curve;

pub use curve::CurveAccount;

use serde::{Deserialize, Serialize};
use toml::Table;

use crate::data::Unit;
use crate::gap::candidates::{Candidate, Suspect};
use crate::gap::experiment::Experiment;
use crate::gap::fit::precision;
use crate::gap::hold_out::Kind;
use crate::gap::insight::{Insight, insight, withhold};
use crate::gap::locate::Region;
use crate::gap::name::{Found, Look, Options, Step, Verdict, Visible, verdict};
use crate::gap::needless::Needless;
use crate::gap::prove::Proof;
use crate::gap::replaced::OtherModel;
use crate::math::random::Stream;
use crate::plugin::effect::On;

/// The whole result of the gap workflow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// What is missing, in a word and with its reasons.
    pub verdict: Verdict,
    /// The probabilities of a false alarm that are spent on names and on gaps without one.
    pub levels: [f64; 2],
    /// Whether the noise of some curve is assumed, for want of replicates.
    pub noise_assumed: bool,
    /// The effects that were found, as a study would add them.
    pub additions: Vec<Addition>,
    /// The steps that led to them.
    pub path: Vec<Passed>,
    /// The probabilities, if nothing were missing, of the largest score, the best cell of the scan and the energy:
    /// without the effects and with them.
    pub p: [[f64; 3]; 2],
    /// Where data and model disagree, without the effects and with them.
    pub regions: [Vec<Spot>; 2],
    /// What this experiment could see of each candidate.
    pub visible: Vec<Visible>,
    /// The size of each type of candidate.
    pub sizes: Vec<Size>,
    /// The calibrated unknowns without the effects and with them.
    pub parameters: Vec<Shift>,
    /// The curves in the order of their outputs.
    pub curves: Vec<CurveAccount>,
    /// The mean of the replicates at each output, and their number; those that were not set aside.
    pub means: Vec<f64>,
    /// See `means`.
    pub counts: Vec<f64>,
    /// The standard deviation of one replicate at each output.
    pub sd: Vec<f64>,
    /// The calibrated response without the effects and with them.
    pub response: [Vec<f64>; 2],
    /// What calibration cannot absorb of the difference from the mean, white, in standard deviations; without the effects
    /// and with them.
    pub left: [Vec<f64>; 2],
    /// What else the search can tell.
    pub insight: Insight,
    /// How the gap fares on what was set aside.
    pub held_out: Vec<HeldOut>,
    /// Other models in place of the study's, each after its own calibration.
    #[serde(default)]
    pub models: Vec<OtherModel>,
    /// What of the study's own is not needed beside the effects.
    #[serde(default)]
    pub needless: Vec<Needless>,
}

/// An excess of the whole misfit that is more probable than this without a gap has no share that effects could explain.
const EXCESS: f64 = 0.05;

/// An effect as a study adds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Addition {
    /// Its name.
    pub name: String,
    /// What kind of effect it is: the name of its plugin, where the study gives no other.
    pub kind: String,
    /// The name of its plugin.
    pub plugin: String,
    /// What it is, for people.
    pub title: String,
    /// Its formula.
    pub formula: String,
    /// Where it acts.
    pub on: On,
    /// Its options.
    pub options: Table,
    /// The inputs of the wide forward map that it sets free, where it acts inside the model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub switches: Vec<usize>,
    /// Whether it is another model in place of the study's; its options are then those of `[model]`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub model: bool,
    /// Its unknowns; of another model the parameters that it shares with the study's.
    pub unknowns: Vec<Estimate>,
    /// The types that these data cannot tell from it, itself first.
    pub class: Vec<String>,
    /// The probability of its type among the candidates.
    pub probability: f64,
}

impl Addition {
    /// What it is told by: its type, or what the study calls the model that it is.
    pub fn label(&self) -> &str {
        if self.model { &self.name } else { &self.kind }
    }
}

/// An unknown with its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// The value of largest posterior density.
    pub value: f64,
    /// The standard deviation by the normal approximation.
    pub sd: f64,
}

/// The size of a type of effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Size {
    /// The type.
    pub kind: String,
    /// The size's name.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
}

/// A calibrated unknown without and with the effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shift {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// Its values.
    pub value: [f64; 2],
    /// Their standard deviations by the normal approximation.
    pub sd: [f64; 2],
    /// The standard deviation of its prior, or of a normal law as wide.
    pub prior_sd: f64,
    /// Whether it lies at an end of its prior's support.
    pub at_bound: [bool; 2],
}

/// A step of the path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Passed {
    /// The probabilities before it, as in [`Account::p`].
    pub p: [f64; 3],
    /// What was weighed, the heaviest first.
    pub leaders: Vec<Leader>,
    /// The log of the odds that any of it acts, against nothing further.
    pub log_odds: f64,
    /// What was added: types and places.
    pub added: Vec<(String, On)>,
    /// The names of effects that were dropped after it.
    pub dropped: Vec<String>,
}

/// An effect that was weighed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Leader {
    /// The name of its plugin.
    pub kind: String,
    /// Where it acts.
    pub on: On,
    /// The log of evidence times prior mass, less that of the heaviest.
    pub log_weight: f64,
    /// Its largest studentised score.
    pub score: f64,
    /// The share of it that the calibrated unknowns absorb.
    pub absorbed: f64,
}

/// A part of the response where data and model disagree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spot {
    /// The curves, by their place in [`Account::curves`].
    pub curves: Vec<usize>,
    /// The first and the last place along the last axis.
    pub span: (f64, f64),
    /// The band of frequencies in which they disagree, in the inverse unit of the last axis; all when `None`.
    pub band: Option<(f64, f64)>,
    /// The probability of a false alarm anywhere.
    pub p: f64,
}

/// What the comparison with one kind of held-out data shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// What was set aside.
    pub kind: Kind,
    /// In words.
    pub names: Vec<String>,
    /// The comparison.
    pub proof: Proof,
    /// The accuracy without and with the effects: the share of outputs inside the held-out replicates' 95 % interval, on the mean
    /// over the groups (Radaideh et al., arXiv 2202.03959); `None` without two replicates.
    pub accuracy: Option<[f64; 2]>,
}

impl Account {
    /// The share of the excess misfit, none to all, that the effects explain in the data they were found in; `None` where there is
    /// no effect, and where the misfit as a whole is that of noise.
    pub fn explained(&self) -> Option<f64> {
        let has_share = !self.additions.is_empty() && self.p[0][2] <= EXCESS;
        has_share.then(|| self.verdict.closed.clamp(0.0, 1.0))
    }

    /// The account of a search, without what was held out.
    pub fn of<'a>(
        found: &Found<'a>,
        candidates: &'a [Candidate],
        options: Options,
        stream: &Stream,
    ) -> Self {
        let first = found.first();
        let looks = [first, &found.last];
        let experiment = found.system.experiment;
        let mut verdict = verdict(found, candidates, options);
        let insight = insight(found, candidates, &verdict, stream);
        withhold(&mut verdict, &insight);
        let (counts, _) = experiment.means();
        Self {
            levels: [options.naming, options.unlisted],
            noise_assumed: found.noise.is_assumed(),
            additions: additions(found, candidates, &verdict),
            path: found.path.iter().map(|step| passed(step, candidates)).collect(),
            p: looks.map(|look| look.p),
            regions: looks.map(|look| spots(experiment, &look.regions)),
            visible: first.visible.clone(),
            sizes: sizes(experiment, candidates),
            parameters: shifts(experiment, looks),
            curves: curve::all(found),
            means: found.means.clone(),
            counts,
            sd: found.noise.sd(experiment, &found.last.fit.at.response),
            response: looks.map(|look| look.fit.at.response.clone()),
            left: looks.map(|look| look.statistics.left.clone()),
            insight,
            held_out: Vec::new(),
            models: Vec::new(),
            needless: Vec::new(),
            verdict,
        }
    }
}

fn additions(found: &Found<'_>, candidates: &[Candidate], verdict: &Verdict) -> Vec<Addition> {
    let placed = found.system.effects.iter().zip(&found.chosen).zip(&verdict.effects);
    placed
        .map(|((effect, suspect), named)| {
            let candidate = &candidates[suspect.candidate];
            let described = candidate.effect.describe();
            let unknowns = effect.hyperparameters().into_iter().enumerate();
            Addition {
                name: named.name.clone(),
                kind: named.kind.clone(),
                plugin: candidate.plugin.clone(),
                title: described.title,
                formula: described.formula,
                on: named.on.clone(),
                options: candidate.options.clone(),
                switches: candidate.effect.switches().to_vec(),
                model: false,
                unknowns: unknowns
                    .map(|(k, unknown)| Estimate {
                        name: unknown.name,
                        unit: unknown.unit,
                        value: named.values[k],
                        sd: named.sd[k],
                    })
                    .collect(),
                class: named.class.clone(),
                probability: named.probability,
            }
        })
        .collect()
}

fn passed(step: &Step, candidates: &[Candidate]) -> Passed {
    let kind = |suspect: &Suspect| candidates[suspect.candidate].kind.clone();
    let best = step.judged.first().map_or(0.0, |j| j.log_weight);
    Passed {
        p: step.before.p,
        log_odds: step.log_odds,
        leaders: step
            .judged
            .iter()
            .map(|j| Leader {
                kind: kind(&j.suspect),
                on: j.suspect.on.clone(),
                log_weight: j.log_weight - best,
                score: j.score,
                absorbed: j.absorbed,
            })
            .collect(),
        added: step.added.iter().map(|s| (kind(s), s.on.clone())).collect(),
        dropped: step.dropped.clone(),
    }
}

fn spots(experiment: &Experiment<'_>, regions: &[Region]) -> Vec<Spot> {
    let spot = |region: &Region| {
        let at = &experiment.curves[region.curves[0]].at;
        // Cosine k of a curve of n even steps has the frequency k / (2 n step).
        let band = region.cell.band.filter(|_| at.len() > 1).map(|(begin, end)| {
            let step = (at[at.len() - 1] - at[0]) / (at.len() - 1) as f64;
            let frequency = |k: usize| k as f64 / (2.0 * at.len() as f64 * step);
            (frequency(begin), frequency(end))
        });
        Spot { curves: region.curves.clone(), span: region.span, band, p: region.p }
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

fn shifts(experiment: &Experiment<'_>, looks: [&Look; 2]) -> Vec<Shift> {
    let sd = looks.map(|look| look.fit.sd());
    let shift = |(j, parameter): (usize, &crate::data::Parameter)| {
        let value = looks.map(|look| look.fit.at.point[j]);
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
