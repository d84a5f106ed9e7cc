//! The verdict: nothing, a name, a class of names, something without a name, or nothing that could be seen.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::look::{Found, Look, Options};
use crate::gap::candidates::Candidate;
use crate::gap::noise::Origin;
use crate::plugin::effect::On;

/// A type is named alone from this probability on.
pub const SURE: f64 = 0.9;

/// A class holds the types that together have this probability.
const CLASS: f64 = 0.95;

/// The share of replicates without which a name must stay.
const STABLE: f64 = 0.8;

/// An effect that differs between conditions or sensors with less probability than this is not what it is called.
const INCONSISTENT: f64 = 0.001;

/// Effects that close so much of the excess misfit, with no excess of the whole left, explain it.
const NEARLY: f64 = 0.9;

/// An excess of the whole misfit that is less probable than this without a gap remains.
const REMAINS: f64 = 0.05;

/// An effect that closes less of the excess misfit than this is no explanation of it, where an excess remains.
const HALF: f64 = 0.5;

/// The normal quantile of 95 %: what remains is more than half when it is so many standard deviations above what was closed.
const CLEAR: f64 = 1.645;

/// Candidates of which less than this is left by the calibration cannot be seen.
const INVISIBLE: f64 = 0.95;

/// The word of a verdict, as `summary.json` has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Word {
    /// Data and model agree within noise and common errors.
    None,
    /// What is missing is named.
    Named,
    /// What is missing is one of a class that these data cannot tell apart.
    Class,
    /// Something is missing that no candidate explains.
    Unlisted,
    /// Whatever may be missing, the calibrated parameters absorb it.
    NotVisible,
}

/// An effect that is missing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Its name in the system.
    pub name: String,
    /// The name of its plugin.
    pub kind: String,
    /// Where it acts.
    pub on: On,
    /// The values of its unknowns.
    pub values: Vec<f64>,
    /// Their standard deviations.
    pub sd: Vec<f64>,
    /// The probability of its type among the candidates.
    pub probability: f64,
    /// The types that these data cannot tell from it, itself first; itself alone when it is sure.
    pub class: Vec<String>,
}

/// A verdict with its reasons.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The word.
    pub word: Word,
    /// The effects that explain most, whether or not they are the name.
    pub effects: Vec<Named>,
    /// The share of the excess misfit that they close, in the replicates they were fitted to.
    pub closed: f64,
    /// Why, in words.
    pub reasons: Vec<String>,
}

/// The verdict on what a search found.
pub fn verdict(found: &Found<'_>, candidates: &[Candidate], options: Options) -> Verdict {
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
            reasons.push("data and model disagree, and no candidate outweighs its absence".into());
            Word::Unlisted
        } else if !first.visible.is_empty() && first.visible.iter().all(|v| v.absorbed > INVISIBLE)
        {
            reasons.push(format!(
                "the calibrated parameters absorb more than {:.0} % of every candidate",
                100.0 * INVISIBLE
            ));
            Word::NotVisible
        } else {
            if found.last.p[0] <= options.naming {
                let p = found.last.p[0];
                reasons.push(format!(
                    "a candidate's score is rare without a gap (p = {p:.3}), but none outweighs its absence"
                ));
            }
            Word::None
        }
    } else {
        let half = less_than_half.then_some(closed);
        doubts(found, gap, half, options, &mut reasons);
        let sure = effects.iter().all(|e| e.class.len() == 1);
        if !reasons.is_empty() {
            Word::Unlisted
        } else if differs {
            // With all of the misfit closed they are of the right kind, and not quite of the right form.
            let kind = explained && widened(&mut effects, &found.types);
            let though = if kind { ", though all of the misfit is theirs" } else { "" };
            reasons.push(format!(
                "the effects that explain most are not the same under all conditions and on all their sensors{though}"
            ));
            if kind { Word::Class } else { Word::Unlisted }
        } else if sure && found.stability >= STABLE {
            Word::Named
        } else {
            Word::Class
        }
    };
    if disagree && !gap {
        reasons.push(
            "a place still disagrees with the effects, though the misfit as a whole is that of noise"
                .into(),
        );
    }
    if found.noise.is_assumed() {
        reasons.push(
            "noise assumed: without replicates, what one record leaves beside its slow part counts as noise"
                .into(),
        );
    } else if found.noise.origins.contains(&Origin::Stated) {
        reasons
            .push("noise stated: without replicates, it is as large as `discrepancy` says".into());
    }
    Verdict { word, effects, closed, reasons }
}

/// Whether what closes this share of the excess misfit explains it, whatever a single place still says.
pub fn explains(closed: f64, last: &Look) -> bool {
    closed >= NEARLY && last.p[2] > REMAINS
}

/// Why the effects are not what is missing.
fn doubts(
    found: &Found<'_>,
    gap: bool,
    less_than_half: Option<f64>,
    options: Options,
    reasons: &mut Vec<String>,
) {
    if gap {
        reasons.push("data and model still disagree with the effects that explain most".into());
    } else if found.last.p[0] <= options.naming && found.chosen.len() >= options.most {
        reasons.push(format!("more than {} effects would be needed", options.most));
    }
    if let Some((place, count)) = crowded(found) {
        reasons.push(format!(
            "{count} effects act on {place} alone: what one sensor shows, together they may fit without being any of them"
        ));
    }
    if let Some(closed) = less_than_half {
        reasons.push(format!(
            "the effects that explain most close {:.0} % of the excess misfit",
            100.0 * closed.max(0.0)
        ));
    }
}

/// The sensor on which alone several of the effects act, with their number, where there are other sensors.
fn crowded(found: &Found<'_>) -> Option<(String, usize)> {
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

/// Adds the next type to those that are alone in their class; whether all have company then.
fn widened(effects: &mut [Named], types: &[Vec<(String, f64)>]) -> bool {
    for (effect, types) in effects.iter_mut().zip(types) {
        if effect.class.len() == 1
            && let Some((other, _)) = types.iter().find(|(other, _)| *other != effect.kind)
        {
            effect.class.push(other.clone());
        }
    }
    effects.iter().all(|effect| effect.class.len() > 1)
}

fn named(found: &Found<'_>, candidates: &[Candidate]) -> Vec<Named> {
    let sd = found.last.fit.sd();
    let mut begin = found.system.experiment.parameters.len();
    let mut all = Vec::new();
    let effects = found.system.effects.iter().zip(&found.chosen).zip(&found.types);
    for ((effect, suspect), types) in effects {
        let end = begin + effect.absent().len();
        let kind = &candidates[suspect.candidate].kind;
        let own = types.iter().find(|(name, _)| name == kind).map_or(0.0, |(_, p)| *p);
        all.push(Named {
            name: effect.name.clone(),
            kind: kind.clone(),
            on: suspect.on.clone(),
            values: found.last.fit.at.point[begin..end].to_vec(),
            sd: sd[begin..end].to_vec(),
            probability: own,
            class: class(kind, own, types),
        });
        begin = end;
    }
    all
}

/// The types of the highest probability that together reach that of a class; the chosen one alone when it is sure.
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
