//! The verdict: no gap, a named effect, a class of effects, an unlisted effect, or no effect that this experiment could
//! show.

use std::collections::{BTreeMap, BTreeSet};

use lacuna::plugin::effect::On;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::diagnostics::{Diagnostics, SearchOptions, SearchResult};
use crate::gap::candidates::Candidate;
use crate::gap::noise::Origin;
use crate::gap::test::is_at_floor;

/// Smallest posterior probability at which a type is named alone.
pub const SURE: f64 = 0.9;

/// Posterior probability that the types of a class reach together.
const CLASS: f64 = 0.95;

/// Smallest share of replicates without which the type stays the same.
const STABLE: f64 = 0.8;

/// The level at which an effect is found to differ between conditions or sensors.
const INCONSISTENT: f64 = 0.001;

/// The share of the excess misfit that effects must close to explain it, with no significant energy left.
const NEARLY: f64 = 0.9;

/// The level at which the energy that is left is significant.
const REMAINS: f64 = 0.05;

/// The share of the excess misfit that an effect must close to be named if an excess remains.
const HALF: f64 = 0.5;

/// The 95 % quantile of the normal distribution, for the test that more than half remains.
const CLEAR: f64 = 1.645;

/// The absorbed share of a candidate above which it counts as not visible.
const INVISIBLE: f64 = 0.95;

/// Verdict of a search, as written in `summary.json`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "GapVerdict")]
pub enum VerdictKind {
    /// Data and model agree within noise and the emulator's error.
    None,
    /// The missing effects are named.
    Named,
    /// A missing effect is one of a class of types that these data cannot distinguish.
    Class,
    /// The data show a gap that no candidate explains.
    Unlisted,
    /// The data show no gap, but the calibrated parameters would absorb nearly all of any candidate.
    NotVisible,
}

/// An effect that is missing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MissingEffect {
    /// The name in the system.
    pub name: String,
    /// The name of its plugin.
    pub kind: String,
    /// Labels on which it acts, by axis; empty for all.
    pub on: On,
    /// The values of its unknowns, in their units.
    pub values: Vec<f64>,
    /// The standard deviations.
    pub sd: Vec<f64>,
    /// The probability of its type among the candidates.
    pub probability: f64,
    /// The types that these data cannot distinguish from it, itself first; itself alone if it is certain.
    pub class: Vec<String>,
}

/// A verdict with its reasons.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The word.
    pub word: VerdictKind,
    /// The effects that explain most of the gap, whether or not they are named.
    pub effects: Vec<MissingEffect>,
    /// The share of the excess misfit that they close, in the replicates they were fitted to.
    pub closed: f64,
    /// The reasons, in words.
    pub reasons: Vec<String>,
}

/// The verdict on the result of a search.
pub fn verdict(
    found: &SearchResult<'_>,
    candidates: &[Candidate],
    options: SearchOptions,
) -> Verdict {
    let first = found.first();
    let (before, after) = (first.excess(), found.last.excess());
    let closed = if before > 0.0 { 1.0 - after / before } else { 0.0 };
    let mut effects = named(found, candidates);
    let noise = found.last.energy_sd;
    let less_than_half = closed < HALF && after - (before - after).max(0.0) > CLEAR * noise;
    let disagree = found.last.p[1].min(found.last.p[2]) <= 0.5 * options.unlisted;
    let explained = !effects.is_empty() && explains(closed, &found.last);
    let scores = !effects.is_empty() && found.last.p[0] <= options.naming;
    let gap = (disagree || scores) && !explained;
    let differs = found.consistency < INCONSISTENT;
    let mut reasons = Vec::new();
    let word = if effects.is_empty() {
        if gap {
            reasons.push(
                "data and model disagree, and the posterior odds of every candidate are against it"
                    .into(),
            );
            VerdictKind::Unlisted
        } else if !first.visible.is_empty() && first.visible.iter().all(|v| v.absorbed > INVISIBLE)
        {
            reasons.push(format!(
                "the calibrated parameters absorb more than {:.0} % of every candidate",
                100.0 * INVISIBLE
            ));
            VerdictKind::NotVisible
        } else {
            if found.last.p[0] <= options.naming {
                let p = found.last.p[0];
                let sign = if is_at_floor(p, options.simulations) { "<=" } else { "=" };
                reasons.push(format!(
                    "the score of a candidate is significant (p {sign} {p:.3}), but the posterior odds favour no effect"
                ));
            }
            VerdictKind::None
        }
    } else {
        let half = less_than_half.then_some(closed);
        doubts(found, gap, half, options, &mut reasons);
        let sure = effects.iter().all(|e| e.class.len() == 1);
        if !reasons.is_empty() {
            VerdictKind::Unlisted
        } else if differs {
            // Effects that explain the whole misfit are of the right type; that they differ between conditions shows
            // that their form is not exact.
            let kind = explained && widened(&mut effects, &found.types);
            let though = if kind { ", though they explain the whole misfit" } else { "" };
            reasons.push(format!(
                "the effects that explain most differ between conditions or between their sensors{though}"
            ));
            if kind { VerdictKind::Class } else { VerdictKind::Unlisted }
        } else if sure && found.stability >= STABLE {
            VerdictKind::Named
        } else {
            VerdictKind::Class
        }
    };
    if disagree && !gap {
        reasons.push(
            "a region still disagrees with the effects, though the energy of the residual is that of noise"
                .into(),
        );
    }
    if found.noise.is_assumed() {
        reasons.push(
            "noise assumed: without replicates, the residual of a single record beside its slow part counts as noise"
                .into(),
        );
    } else if found.noise.origins.contains(&Origin::Stated) {
        reasons.push("noise stated: without replicates, the noise is that of `discrepancy`".into());
    }
    Verdict { word, effects, closed, reasons }
}

/// Returns true if effects that close this share of the excess misfit explain it, even if a single region still
/// disagrees.
pub fn explains(closed: f64, last: &Diagnostics) -> bool {
    closed >= NEARLY && last.p[2] > REMAINS
}

/// The reasons against naming the effects.
fn doubts(
    found: &SearchResult<'_>,
    gap: bool,
    less_than_half: Option<f64>,
    options: SearchOptions,
    reasons: &mut Vec<String>,
) {
    if gap {
        reasons.push("data and model still disagree with the effects that explain most".into());
    } else if found.last.p[0] <= options.naming && found.chosen.len() >= options.most {
        reasons.push(format!("more than {} effects would be needed", options.most));
    }
    if let Some((place, count)) = crowded(found) {
        reasons.push(format!(
            "{count} effects act on {place} alone: several effects can fit the record of one sensor without any of them being true"
        ));
    }
    if let Some(closed) = less_than_half {
        reasons.push(format!(
            "the effects that explain most close {:.0} % of the excess misfit",
            100.0 * closed.max(0.0)
        ));
    }
}

/// The sensor on which several of the effects act alone, with their number; `None` if there are no other sensors.
fn crowded(found: &SearchResult<'_>) -> Option<(String, usize)> {
    let experiment = found.system.experiment;
    let mut counts: BTreeMap<&[(String, String)], usize> = BTreeMap::new();
    for effect in &found.system.effects {
        let acted =
            experiment.curves.iter().filter(|c| effect.acts[c.outputs.clone()].contains(&true));
        let sensors: BTreeSet<_> = acted.map(|curve| curve.labels.as_slice()).collect();
        if let [sensor] = Vec::from_iter(sensors)[..] {
            *counts.entry(sensor).or_default() += 1;
        }
    }
    let (sensor, count) = counts.into_iter().find(|(_, count)| *count > 1)?;
    let has_others = experiment.curves.iter().any(|curve| curve.labels != sensor);
    let name = sensor.iter().map(|(_, label)| label.as_str()).collect::<Vec<_>>().join(" ");
    has_others.then_some((name, count))
}

/// Adds the next type to those that are alone in their class; returns true if every class then has several types.
fn widened(effects: &mut [MissingEffect], types: &[Vec<(String, f64)>]) -> bool {
    for (effect, types) in effects.iter_mut().zip(types) {
        if effect.class.len() == 1
            && let Some((other, _)) = types.iter().find(|(other, _)| *other != effect.kind)
        {
            effect.class.push(other.clone());
        }
    }
    effects.iter().all(|effect| effect.class.len() > 1)
}

fn named(found: &SearchResult<'_>, candidates: &[Candidate]) -> Vec<MissingEffect> {
    let sd = found.last.fit.sd();
    let mut begin = found.system.experiment.parameters.len();
    let mut all = Vec::new();
    let effects = found.system.effects.iter().zip(&found.chosen).zip(&found.types);
    for ((effect, placement), types) in effects {
        let end = begin + effect.absent().len();
        let kind = &candidates[placement.candidate].kind;
        let own = types.iter().find(|(name, _)| name == kind).map_or(0.0, |(_, p)| *p);
        all.push(MissingEffect {
            name: effect.name.clone(),
            kind: kind.clone(),
            on: placement.on.clone(),
            values: found.last.fit.at.point[begin..end].to_vec(),
            sd: sd[begin..end].to_vec(),
            probability: own,
            class: class(kind, own, types),
        });
        begin = end;
    }
    all
}

/// The most probable types that together reach 95 %; the chosen type alone if its probability is at least 0.9.
pub fn class(kind: &str, own: f64, types: &[(String, f64)]) -> Vec<String> {
    let mut class = vec![kind.to_owned()];
    let mut sum = own;
    if own >= SURE {
        return class;
    }
    for (other, p) in types.iter().filter(|(other, _)| other != kind) {
        if sum >= CLASS {
            break;
        }
        class.push(other.clone());
        sum += p;
    }
    class
}
