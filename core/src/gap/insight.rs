//! What else a search can tell of a gap: whether model or sensor is wrong, how well the explanation foretells, what would tell a
//! class apart, and what is known of something without a name.

use serde::{Deserialize, Serialize};

use super::candidates::Candidate;
use super::drift::{self, drift};
use super::fit::Fit;
use super::name::{
    Foretelling, Found, Judged, LeftOut, Named, Rival, Separations, Verdict, Word, foretell,
    separate,
};
use super::system::System;
use super::unlisted::{Description, Stopgap, Symbolic, describe, stopgap, symbolic};
use super::whitener::Whitener;
use crate::math::random::Stream;

/// Simulations of the drift map's and the symbolic form's nulls.
const SIMULATIONS: usize = 99;

/// An explanation that foretells worse than another by so many standard errors is not named alone.
const AGAINST: f64 = 2.0;

/// Conditions that may disagree about two explanations.
const SEVERAL: usize = 4;

/// What an explanation without a rival is compared with.
pub const NOTHING: &str = "nothing";

/// What a search can tell besides its verdict; all empty where nothing is missing.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Insight {
    /// What the best explanation is compared with by what it foretells: a type, or `nothing`.
    pub against: Option<String>,
    /// The comparison, one for each way of leaving data out.
    pub foretold: Vec<Foretelling>,
    /// Each place in words, where something without a name is missing.
    pub places: Vec<Description>,
    /// The calibrated parameters by condition and window, without any effect.
    pub drift: Option<drift::Map>,
    /// What would tell the members of a class apart.
    pub separations: Option<Separations>,
    /// A process in the place of what has no name.
    pub stopgap: Option<Stopgap>,
    /// A form of it.
    pub symbolic: Option<Symbolic>,
}

/// A system that was weighed, with its fit.
struct Weighed<'a> {
    kind: String,
    system: System<'a>,
    fit: Fit,
}

impl<'a> Weighed<'a> {
    fn of(found: &Found<'a>, candidates: &'a [Candidate], judged: &Judged) -> Self {
        let experiment = found.system.experiment;
        let kind = candidates[judged.suspect.candidate].kind.clone();
        let placed = judged.suspect.placed(experiment, candidates, &kind);
        let system = System::new(experiment, vec![placed]);
        Self { kind, system, fit: judged.fit.clone() }
    }

    fn rival(&self) -> Rival<'a, '_> {
        Rival { system: &self.system, fit: &self.fit }
    }
}

/// Everything besides the verdict that a search can tell.
pub fn insight<'a>(
    found: &Found<'a>,
    candidates: &'a [Candidate],
    verdict: &Verdict,
    stream: &Stream,
) -> Insight {
    let mut insight = Insight::default();
    if matches!(verdict.word, Word::None | Word::NotVisible) {
        return insight;
    }
    let experiment = found.system.experiment;
    let base = System::new(experiment, Vec::new());
    let first = found.path.first().map_or(&found.last, |step| &step.before);
    let whitener = Whitener::new(experiment, &found.noise, &first.fit.at.response);
    let options = drift::Options { simulations: SIMULATIONS, ..drift::Options::default() };
    let drifting = stream.named("drift map");
    insight.drift = drift(&base, &first.fit, &found.noise, &whitener, options, &drifting);
    if let Some(named) = verdict.effects.first() {
        let winner = Rival { system: &found.system, fit: &found.last.fit };
        let alone = alone(found, candidates);
        let tried = candidates.len();
        // The second of several effects has no runner-up that was fitted beside the first.
        let rival = alone.iter().find(|weighed| weighed.kind != named.kind);
        insight.against = Some(rival.map_or(NOTHING.to_owned(), |weighed| weighed.kind.clone()));
        let nothing = Rival { system: &base, fit: &first.fit };
        let second = rival.map_or(nothing, Weighed::rival);
        insight.foretold = foretell(winner, second, &found.noise, tried);
        if found.chosen.iter().all(|suspect| !suspect.on.is_empty()) {
            // Without the sensor that an effect acts on nothing is known of it but its prior: that compares priors.
            insight.foretold.retain(|one| one.left_out != LeftOut::Sensor);
        }
        insight.separations = separations(found, &alone, named);
    }
    if verdict.word == Word::Unlisted {
        unnamed(found, &mut insight, stream);
    }
    insight
}

/// The best of each type, where the search ended with one effect; the heaviest first.
fn alone<'a>(found: &Found<'a>, candidates: &'a [Candidate]) -> Vec<Weighed<'a>> {
    let mut all: Vec<Weighed<'a>> = Vec::new();
    if let ([step], 1) = (found.path.as_slice(), found.chosen.len()) {
        for judged in &step.judged {
            let kind = &candidates[judged.suspect.candidate].kind;
            if !all.iter().any(|weighed| weighed.kind == *kind) {
                all.push(Weighed::of(found, candidates, judged));
            }
        }
    }
    all
}

fn separations(found: &Found<'_>, alone: &[Weighed<'_>], named: &Named) -> Option<Separations> {
    let members: Vec<Rival<'_, '_>> =
        alone.iter().filter(|w| named.class.contains(&w.kind)).map(Weighed::rival).collect();
    separate(&members, &found.noise)
}

/// What is known of something without a name: on top of the effects that explain most of it.
fn unnamed(found: &Found<'_>, insight: &mut Insight, stream: &Stream) {
    let (system, last) = (&found.system, &found.last);
    let first = found.path.first().map_or(last, |step| &step.before);
    // Where the effects have taken the places, those before them are what is there to tell.
    let look = if last.regions.is_empty() { first } else { last };
    let place = |region| describe(system.experiment, region, &look.statistics.left);
    insight.places = look.regions.iter().map(place).collect();
    let base = System::new(system.experiment, Vec::new());
    let system = if last.regions.is_empty() { &base } else { system };
    let (noise, regions, fit) = (&found.noise, &look.regions, &look.fit);
    let whitener = Whitener::new(system.experiment, noise, &fit.at.response);
    let excess = look.statistics.energy - look.expected_energy;
    insight.stopgap = stopgap(system, fit, noise, &whitener, regions, excess);
    let stream = stream.named("symbolic");
    insight.symbolic = symbolic(system, fit, &whitener, regions, excess, SIMULATIONS, &stream);
}

/// The verdict as far as it stands against another explanation: a name is one of a class with what foretells better, and with what
/// some conditions prefer where they do not tell the two apart together.
///
/// Where neither is quite true, the probability of the data is decided by a few conditions, overly sure (Yang and Zhu, Proceedings
/// of the National Academy of Sciences 115 (2018) 1854); how conditions differ shows it.
pub fn withhold(verdict: &mut Verdict, insight: &Insight) {
    let Some(against) = insight.against.as_ref().filter(|kind| *kind != NOTHING) else { return };
    if verdict.word != Word::Named || verdict.effects.len() != 1 {
        return;
    }
    let worse = |f: &&Foretelling| f.error.is_some_and(|e| f.difference < -AGAINST * e);
    let divided = |f: &&Foretelling| {
        f.left_out == LeftOut::Condition
            && f.parts >= SEVERAL
            && f.against > 0
            && f.scatter.is_some_and(|e| f.difference < AGAINST * e)
    };
    let reason = if let Some(worse) = insight.foretold.iter().find(worse) {
        let left_out = worse.left_out.words();
        format!("`{against}` foretells better what is left out by {left_out}")
    } else if let Some(divided) = insight.foretold.iter().find(divided) {
        let (parts, against_it) = (divided.parts, divided.against);
        format!(
            "`{against}` foretells {against_it} of {parts} conditions better by far, and all together do not decide"
        )
    } else {
        return;
    };
    verdict.word = Word::Class;
    verdict.effects[0].class.push(against.clone());
    verdict.reasons.push(reason);
}
