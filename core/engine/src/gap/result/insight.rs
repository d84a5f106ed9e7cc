//! Results of a search besides its verdict: the drift map, cross-validation of the best explanation, data that would
//! discriminate between the members of a class, and a description of an unlisted effect.

use lacuna::math::random::Stream;
use serde::{Deserialize, Serialize};

use crate::gap::candidates::Candidate;
use crate::gap::drift;
use crate::gap::drift::drift;
use crate::gap::next::NextData;
use crate::gap::search::{
    CrossValidation, Discrimination, Explanation, LeftOut, MissingEffect, SearchResult, Verdict,
    VerdictKind, Weighed, cross_validate, discriminate,
};
use crate::gap::system::System;
use crate::gap::system::fit::Fit;
use crate::gap::system::whitener::Whitener;
use crate::gap::unlisted::{ResidualDescription, Smoother, Symbolic, describe, smooth, symbolic};

/// The number of simulations of the null distributions of the drift map and of the symbolic form.
pub const SIMULATIONS: usize = 99;

/// The number of standard errors by which another explanation must predict better to turn a name into a class.
const AGAINST: f64 = 2.0;

/// The smallest number of conditions of which some may favour another explanation.
const SEVERAL: usize = 4;

/// The name of the model without effects, with which an explanation without a competitor is compared.
pub const NOTHING: &str = "nothing";

/// The results of a search besides its verdict; empty if nothing is missing.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Insight {
    /// The type with which the best explanation is cross-validated, or `nothing`.
    pub against: Option<String>,
    /// The cross-validation, one entry for each kind of part that is left out.
    #[serde(rename = "foretold")]
    pub cross_validation: Vec<CrossValidation>,
    /// The description of each region, for an unlisted effect.
    pub places: Vec<ResidualDescription>,
    /// The calibrated parameters by condition and window, without any effect.
    pub drift: Option<drift::DriftMap>,
    /// The data that would discriminate between the members of a class.
    #[serde(rename = "separations")]
    pub discrimination: Option<Discrimination>,
    /// The bits that further data are expected to give.
    #[serde(default)]
    pub next: Option<NextData>,
    /// A smoother in place of an unlisted effect.
    #[serde(rename = "stopgap")]
    pub smoother: Option<Smoother>,
    /// A symbolic form of an unlisted effect.
    pub symbolic: Option<Symbolic>,
}

/// A single effect that was weighed, with its fit.
struct SingleEffect<'a> {
    kind: String,
    system: System<'a>,
    fit: Fit,
}

impl<'a> SingleEffect<'a> {
    fn of(found: &SearchResult<'a>, candidates: &'a [Candidate], weighed: &Weighed) -> Self {
        let experiment = found.system.experiment;
        let kind = candidates[weighed.placement.candidate].kind.clone();
        let placed = weighed.placement.placed(experiment, candidates, &kind);
        let system = System::new(experiment, vec![placed]);
        Self { kind, system, fit: weighed.fit.clone() }
    }

    fn explanation(&self) -> Explanation<'a, '_> {
        Explanation::exact(&self.system, &self.fit)
    }
}

/// All results of a search besides its verdict.
pub fn insight<'a>(
    found: &SearchResult<'a>,
    candidates: &'a [Candidate],
    verdict: &Verdict,
    stream: &Stream,
) -> Insight {
    let mut insight = Insight::default();
    if matches!(verdict.word, VerdictKind::None | VerdictKind::NotVisible) {
        return insight;
    }
    let experiment = found.system.experiment;
    let base = System::new(experiment, Vec::new());
    let first = found.path.first().map_or(&found.last, |step| &step.before);
    let whitener = Whitener::new(experiment, &found.noise, &first.fit.at.response);
    let options =
        drift::DriftOptions { simulations: SIMULATIONS, ..drift::DriftOptions::default() };
    let drifting = stream.named("drift map");
    insight.drift = drift(&base, &first.fit, &found.noise, &whitener, options, &drifting);
    let has_names =
        matches!(verdict.word, VerdictKind::Named | VerdictKind::Approximate | VerdictKind::Class);
    if let Some(map) = insight.drift.as_mut().filter(|_| has_names) {
        let by: Vec<String> = verdict.effects.iter().map(|effect| effect.kind.clone()).collect();
        (map.reading, map.words) = map.reading.explained(&map.words, &by);
    }
    if let Some(named) = verdict.effects.first() {
        let winner = Explanation::exact(&found.system, &found.last.fit);
        let alone = alone(found, candidates);
        let tried = candidates.len();
        // Of several effects, the second has no runner-up that was fitted together with the first.
        let other = alone.iter().find(|single| single.kind != named.kind);
        insight.against = Some(other.map_or(NOTHING.to_owned(), |single| single.kind.clone()));
        let nothing = Explanation::exact(&base, &first.fit);
        let second = other.map_or(nothing, SingleEffect::explanation);
        insight.cross_validation = cross_validate(winner, second, &found.noise, tried);
        if found.chosen.iter().all(|placement| !placement.on.is_empty()) {
            // Without the sensor on which an effect acts, only its prior is known: the score would compare priors.
            insight.cross_validation.retain(|one| one.left_out != LeftOut::Sensor);
        }
        insight.discrimination = discrimination(found, &alone, named);
    }
    if matches!(verdict.word, VerdictKind::Unlisted | VerdictKind::Approximate) {
        unnamed(found, &mut insight, stream);
    }
    insight
}

/// The best of each type if the search ended with one effect, in decreasing order of weight.
fn alone<'a>(found: &SearchResult<'a>, candidates: &'a [Candidate]) -> Vec<SingleEffect<'a>> {
    let mut all: Vec<SingleEffect<'a>> = Vec::new();
    if let ([step], 1) = (found.path.as_slice(), found.chosen.len()) {
        for weighed in &step.weighed {
            let kind = &candidates[weighed.placement.candidate].kind;
            if !all.iter().any(|single| single.kind == *kind) {
                all.push(SingleEffect::of(found, candidates, weighed));
            }
        }
    }
    all
}

fn discrimination(
    found: &SearchResult<'_>,
    alone: &[SingleEffect<'_>],
    named: &MissingEffect,
) -> Option<Discrimination> {
    let members: Vec<Explanation<'_, '_>> = alone
        .iter()
        .filter(|w| named.class.contains(&w.kind))
        .map(SingleEffect::explanation)
        .collect();
    discriminate(&members, &found.noise)
}

/// The description of an unlisted effect, in addition to the effects that explain most of it.
fn unnamed(found: &SearchResult<'_>, insight: &mut Insight, stream: &Stream) {
    let (system, last) = (&found.system, &found.last);
    let first = found.path.first().map_or(last, |step| &step.before);
    // If the effects have removed the regions, those before them are described.
    let diagnostics = if last.regions.is_empty() { first } else { last };
    let place = |region| describe(system.experiment, region, &diagnostics.statistics.residual);
    insight.places = diagnostics.regions.iter().map(place).collect();
    let base = System::new(system.experiment, Vec::new());
    let system = if last.regions.is_empty() { &base } else { system };
    let (noise, regions, fit) = (&found.noise, &diagnostics.regions, &diagnostics.fit);
    let whitener = Whitener::new(system.experiment, noise, &fit.at.response);
    let excess = diagnostics.statistics.energy - diagnostics.expected_energy;
    insight.smoother = smooth(system, fit, noise, &whitener, regions, excess);
    let stream = stream.named("symbolic");
    insight.symbolic = symbolic(system, fit, &whitener, regions, excess, SIMULATIONS, &stream);
}

/// Turns a name into a class if cross-validation does not support it: if another explanation predicts left-out data
/// better, or if some conditions favour it strongly and all together do not decide.
///
/// If neither explanation is exactly true, evidences are dominated by a few conditions and overconfident (Yang and Zhu,
/// Proceedings of the National Academy of Sciences 115 (2018) 1854); the variation between conditions shows it.
pub fn withhold(verdict: &mut Verdict, insight: &Insight) {
    let Some(against) = insight.against.as_ref().filter(|kind| *kind != NOTHING) else { return };
    if verdict.word != VerdictKind::Named || verdict.effects.len() != 1 {
        return;
    }
    let worse = |f: &&CrossValidation| f.error.is_some_and(|e| f.difference < -AGAINST * e);
    let divided = |f: &&CrossValidation| {
        f.left_out == LeftOut::Condition
            && f.parts >= SEVERAL
            && f.against > 0
            && f.scatter.is_some_and(|e| f.difference < AGAINST * e)
    };
    let reason = if let Some(worse) = insight.cross_validation.iter().find(worse) {
        let left_out = worse.left_out.words();
        format!("`{against}` predicts left-out data better, by {left_out}")
    } else if let Some(divided) = insight.cross_validation.iter().find(divided) {
        let (parts, against_it) = (divided.parts, divided.against);
        format!(
            "`{against}` predicts {against_it} of {parts} conditions much better, and all conditions together do not decide"
        )
    } else {
        return;
    };
    verdict.word = VerdictKind::Class;
    verdict.effects[0].class.push(against.clone());
    verdict.reasons.push(reason);
}
