//! Selection and number of the cases.

use generator::{Case, Kind, SENSORS};
use lacuna_engine::gap::search::{MissingEffect, SearchOptions};
use rayon::prelude::*;

use super::chain::{Answer, ask, prepare};

/// Hidden effects that are in the library, with the name that they should get.
pub const LISTED: [(Kind, &str); 14] = [
    (Kind::Gain, "gain"),
    (Kind::Offset, "offset"),
    (Kind::Drift, "drift"),
    (Kind::Delay, "delay"),
    (Kind::LowPass, "low_pass"),
    (Kind::Echo, "echo"),
    (Kind::Damping, "damping"),
    (Kind::Saturation, "saturation"),
    (Kind::SecondaryPulse, "secondary_pulse"),
    (Kind::Flash, "flash"),
    (Kind::PulseHeating, "pulse_heating"),
    (Kind::LevelJump, "level_jumps"),
    (Kind::Resonance, "resonance"),
    (Kind::Crosstalk, "crosstalk"),
];

/// Hidden physics that is not in the library.
pub const UNLISTED: [Kind; 5] =
    [Kind::Burst, Kind::Switching, Kind::Cubic, Kind::Drag, Kind::Rectified];

fn number(variable: &str, otherwise: u64) -> u64 {
    std::env::var(variable).ok().and_then(|n| n.parse().ok()).unwrap_or(otherwise)
}

/// Number of cases: the fraction `of / 126` of `LACUNA_GAP_CASES`, but at least `least`.
pub fn count(of: u64, least: u64) -> u64 {
    (number("LACUNA_GAP_CASES", 7) * of / 126).max(least)
}

/// Options of a search: 199 simulations where `LACUNA_GAP_CASES` asks for counts, otherwise half of them.
pub fn options() -> SearchOptions {
    let simulations = if std::env::var_os("LACUNA_GAP_CASES").is_some() { 199 } else { 99 };
    SearchOptions { naming: 0.03, unlisted: 0.02, simulations, most: 3 }
}

/// Name that a kind should get; its own if it is not in the library.
pub fn name(kind: Kind) -> String {
    let listed = LISTED.iter().find(|(other, _)| *other == kind);
    listed.map_or_else(|| format!("{kind:?}").to_lowercase(), |(_, name)| (*name).to_owned())
}

/// Specification of a case.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Hidden effects, and the sensors they act on.
    pub kinds: Vec<(Kind, Vec<usize>)>,
    /// Size of the effect relative to the noise.
    pub ratio: f64,
    /// Number of replicates for the search.
    pub replicates: usize,
    /// Number of held-out replicates for the proof.
    pub held_out: usize,
}

impl Plan {
    /// A case with 8, 12 or 20 replicates.
    pub fn new(i: u64, kinds: Vec<(Kind, Vec<usize>)>, ratio: f64) -> Self {
        Self { kinds, ratio, replicates: [8, 12, 20][(i % 3) as usize], held_out: 0 }
    }
}

/// A case with the workflow's answer.
pub struct Asked {
    pub plan: Plan,
    pub case: Case,
    pub answer: Answer,
}

/// Runs all cases; `family` keeps the data of different tests independent.
pub fn asked(family: u64, plans: Vec<Plan>) -> Vec<Asked> {
    prepare();
    let base = 1_000_000 * (100 * number("LACUNA_GAP_SEED", 1) + family);
    let one = |(i, plan): (usize, Plan)| {
        let (seed, all) = (base + i as u64, plan.replicates + plan.held_out);
        let case = generator::case(seed, &plan.kinds, plan.ratio, all);
        let answer = ask(&case, plan.replicates, seed);
        Asked { plan, case, answer }
    };
    plans.into_par_iter().enumerate().map(one).collect()
}

impl Asked {
    /// Names that should be given.
    pub fn truths(&self) -> Vec<String> {
        self.plan.kinds.iter().map(|(kind, _)| name(*kind)).collect()
    }

    /// Description of the case and its answer, in one line.
    pub fn said(&self) -> String {
        let hidden = self.case.hidden.iter().map(|h| {
            let sensors: Vec<&str> = h.sensors.iter().map(|&s| SENSORS[s]).collect();
            format!("{} on {} {:.3} {:.2?}", name(h.kind), sensors.join("+"), h.size, h.shape)
        });
        let one = |e: &MissingEffect| {
            let places: Vec<String> = e.on.values().map(|labels| labels.join("+")).collect();
            let each = e.values.iter().zip(&e.sd).map(|(x, sd)| format!("{x:.3}±{sd:.3}"));
            let values: Vec<String> = each.collect();
            let (class, on) = (e.class.join("/"), places.join(" "));
            format!("{class} on {on} {:.2} ({})", e.probability, values.join(" "))
        };
        let verdict = &self.answer.verdict;
        let effects: Vec<String> = verdict.effects.iter().map(one).collect();
        format!(
            "R {} rms {}: {} -> {:?} {:?} odds {:.1} [{}] closed {:.2} {:?}",
            self.plan.replicates,
            self.plan.ratio,
            hidden.collect::<Vec<_>>().join(", "),
            verdict.word,
            self.answer.p,
            self.answer.log_odds,
            effects.join("; "),
            verdict.closed,
            verdict.reasons
        )
    }
}
