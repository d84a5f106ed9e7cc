//! The grounds of a verdict: what is left of the gap, and the doubts about the effects that were found.

use std::collections::{BTreeMap, BTreeSet};

use super::{CLEAR, HALF, LIKELY, MissingEffect, NEARLY, REMAINS};
use crate::gap::search::diagnostics::{Diagnostics, SearchOptions, SearchResult};

/// The quantities on which a verdict rests.
pub(super) struct Grounds {
    /// The share of the gap that the effects close.
    pub closed: f64,
    /// True when the scan or the energy still rejects.
    pub disagree: bool,
    /// True when the effects close nearly all of the misfit and its energy is that of noise.
    pub explained: bool,
    /// True when a test still rejects and the effects do not explain the misfit.
    pub gap: bool,
    /// The reasons against the effects, in words.
    pub doubts: Vec<String>,
}

impl Grounds {
    pub fn of(found: &SearchResult<'_>, options: SearchOptions, effects: &[MissingEffect]) -> Self {
        let closed = closed(found);
        let disagree = found.last.p[1].min(found.last.p[2]) <= 0.5 * options.unlisted;
        let explained = !effects.is_empty() && explains(closed, &found.last);
        let scores = !effects.is_empty() && found.last.p[0] <= options.naming;
        let gap = (disagree || scores) && !explained;
        let doubts = [
            crowded(found),
            contradicted(effects),
            may_be_zero(found, effects),
            exhausted(found, gap, options),
            closes_less_than_half(found, closed),
        ];
        let doubts = if effects.is_empty() { Vec::new() } else { Vec::from(doubts) };
        Self { closed, disagree, explained, gap, doubts: doubts.into_iter().flatten().collect() }
    }
}

/// The share of the gap that the effects of a search close.
pub(super) fn closed(found: &SearchResult<'_>) -> f64 {
    if found.chosen.is_empty() { 0.0 } else { found.explained.share() }
}

/// Returns true if effects that close this share of the gap explain it, even if a single region still disagrees.
pub fn explains(closed: f64, last: &Diagnostics) -> bool {
    closed >= NEARLY && last.p[2] > REMAINS
}

/// Effects in whose place a free form predicts left-out data as well.
pub(super) fn unproven(effects: &[MissingEffect]) -> Option<String> {
    let names = names(effects, |effect| !effect.supported && !effect.contradicted)?;
    Some(format!("a free form in place of {names} predicts left-out data as well"))
}

/// Effects whose class is wrong in most of the simulated cases like this one.
pub(super) fn improbable(effects: &[MissingEffect]) -> Option<String> {
    let is_one = |e: &MissingEffect| e.traits.is_some_and(|t| t.probability() < LIKELY);
    let names = names(effects, is_one)?;
    Some(format!(
        "in simulated cases like this one, names such as {names} are more often wrong than right"
    ))
}

/// Effects that are left to the remainder.
pub(super) fn left_out(uncertain: &[String]) -> Option<String> {
    let names: Vec<String> = uncertain.iter().map(|name| format!("`{name}`")).collect();
    (!names.is_empty()).then(|| {
        format!(
            "{} would explain more, but not with certainty: it counts as a remainder",
            names.join(" and ")
        )
    })
}

/// Effects that do not foretell the later blocks of single records better than a free form does.
pub(super) fn unforetold(found: &SearchResult<'_>, effects: &[MissingEffect]) -> Option<String> {
    if found.system.experiment.most_replicates() > 1 {
        return None;
    }
    let fails = effects.iter().zip(&found.support).filter(|(_, support)| !support.foretells());
    let names: Vec<String> = fails.map(|(effect, _)| format!("`{}`", effect.name)).collect();
    (!names.is_empty()).then(|| {
        let names = names.join(" and ");
        format!("a free form in place of {names} foretells the later parts of the record as well")
    })
}

/// Effects in whose place a free form predicts left-out data better.
fn contradicted(effects: &[MissingEffect]) -> Option<String> {
    let names = names(effects, |effect| effect.contradicted)?;
    Some(format!("a free form in place of {names} predicts left-out data better"))
}

/// Effects whose size may be zero by the normal approximation of its posterior.
fn may_be_zero(found: &SearchResult<'_>, effects: &[MissingEffect]) -> Option<String> {
    let mut all = effects.iter().zip(&found.system.effects);
    all.find_map(|(effect, placed)| {
        let (size, sd) = (effect.values[0] - placed.absent()[0], effect.sd[0]);
        (size.abs() < CLEAR * sd).then(|| {
            format!(
                "the size of `{}` may be zero: {size:.3e} with a standard deviation of {sd:.1e}",
                effect.name
            )
        })
    })
}

fn names(effects: &[MissingEffect], is_one: impl Fn(&MissingEffect) -> bool) -> Option<String> {
    let names: Vec<String> =
        effects.iter().filter(|e| is_one(e)).map(|e| format!("`{}`", e.name)).collect();
    (!names.is_empty()).then(|| names.join(" and "))
}

fn exhausted(found: &SearchResult<'_>, gap: bool, options: SearchOptions) -> Option<String> {
    let wants = !gap && found.last.p[0] <= options.naming && found.chosen.len() >= options.most;
    wants.then(|| format!("more than {} effects would be needed", options.most))
}

fn closes_less_than_half(found: &SearchResult<'_>, closed: f64) -> Option<String> {
    let (before, after) = (found.first().excess(), found.last.excess());
    let noise = found.last.energy_sd;
    let less = closed < HALF && after - (before - after).max(0.0) > CLEAR * noise;
    less.then(|| {
        format!("the effects that explain most close {:.0} % of the gap", 100.0 * closed.max(0.0))
    })
}

/// Several effects on one sensor alone, if there are other sensors.
fn crowded(found: &SearchResult<'_>) -> Option<String> {
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
    let place = sensor.iter().map(|(_, label)| label.as_str()).collect::<Vec<_>>().join(" ");
    has_others.then(|| {
        format!(
            "{count} effects act on {place} alone: several effects can fit the record of one sensor without any of them being true"
        )
    })
}
