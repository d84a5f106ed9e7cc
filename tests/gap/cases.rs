//! Which cases are asked, and how many.

use generator::{Case, Kind, SENSORS};
use lacuna::gap::name::Named;
use rayon::prelude::*;

use super::chain::{Answer, ask, prepare};

/// The effects of the library that are hidden, by the name that they should get.
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

/// Physics that no candidate has.
pub const UNLISTED: [Kind; 5] =
    [Kind::Burst, Kind::Switching, Kind::Cubic, Kind::Drag, Kind::Rectified];

fn number(variable: &str, otherwise: u64) -> u64 {
    std::env::var(variable).ok().and_then(|n| n.parse().ok()).unwrap_or(otherwise)
}

/// The share `of` 126 of as many single effects as `LACUNA_GAP_CASES` says; not less than `least`.
pub fn count(of: u64, least: u64) -> u64 {
    (number("LACUNA_GAP_CASES", 7) * of / 126).max(least)
}

/// The name that a kind should get; its own where it is of no library.
pub fn name(kind: Kind) -> String {
    let listed = LISTED.iter().find(|(other, _)| *other == kind);
    listed.map_or_else(|| format!("{kind:?}").to_lowercase(), |(_, name)| (*name).to_owned())
}

/// A case that is to be asked.
#[derive(Debug, Clone)]
pub struct Plan {
    /// What is hidden where.
    pub kinds: Vec<(Kind, Vec<usize>)>,
    /// How large it is.
    pub ratio: f64,
    /// Replicates to find it with.
    pub replicates: usize,
    /// Replicates to prove it with.
    pub held_out: usize,
}

impl Plan {
    /// With 8, 12 or 20 replicates.
    pub fn new(i: u64, kinds: Vec<(Kind, Vec<usize>)>, ratio: f64) -> Self {
        Self { kinds, ratio, replicates: [8, 12, 20][(i % 3) as usize], held_out: 0 }
    }
}

/// A case with its answer.
pub struct Asked {
    pub plan: Plan,
    pub case: Case,
    pub answer: Answer,
}

/// Asks all; `family` keeps the data of different tests apart.
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
    /// The names that should be given.
    pub fn truths(&self) -> Vec<String> {
        self.plan.kinds.iter().map(|(kind, _)| name(*kind)).collect()
    }

    /// Everything in one line.
    pub fn said(&self) -> String {
        let hidden = self.case.hidden.iter().map(|h| {
            let sensors: Vec<&str> = h.sensors.iter().map(|&s| SENSORS[s]).collect();
            format!("{} on {} {:.3} {:.2?}", name(h.kind), sensors.join("+"), h.size, h.shape)
        });
        let one = |e: &Named| {
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
