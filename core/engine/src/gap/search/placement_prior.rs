//! The prior mass of a placement within its type.

use lacuna::math::special::ln_binomial;
use lacuna::plugin::effect::Reach;

use crate::gap::candidates::{Candidate, Placement, log_group_share};

/// The prior odds of a law against a candidate that contains it as a special case, once more for each further candidate
/// that contains that one: most missing physics has the exponent of a textbook.
const GENERAL: f64 = 4.0;

/// The log prior mass of a placement within its type, divided among the variants of the type and among the forms from
/// which the data chose it, plus the log of the type's share by the [odds](log_group_share) of its group.
pub fn placement_prior(candidates: &[Candidate], placement: &Placement, sensors: usize) -> f64 {
    let candidate = &candidates[placement.candidate];
    let versions = candidates.iter().filter(|c| c.kind == candidate.kind).count();
    let chosen = (!placement.on.is_empty()).then(|| chosen(placement));
    let place = log_prior(candidate.effect.reach(), chosen, sensors) - (versions as f64).ln();
    let form = -f64::from(generality(candidates, candidate)) * GENERAL.ln();
    place + form - (candidate.tried as f64).ln() + log_group_share(candidates, candidate)
}

/// The number of candidates in the longest chain of special cases of a candidate, each contained in the one before.
fn generality(candidates: &[Candidate], candidate: &Candidate) -> u32 {
    let special = candidates.iter().filter(|c| candidate.contains.contains(&c.kind.as_str()));
    special.map(|c| 1 + generality(candidates, c)).max().unwrap_or(0)
}

/// The number of sensors that a placement acts on, by the labels of its place.
fn chosen(placement: &Placement) -> usize {
    placement.on.values().map(Vec::len).product()
}

/// The log prior mass of a place within a type of effect: a third each for all sensors, for one sensor, and for a group
/// of a size between, all sizes and all members being equally probable. `chosen` is the number of sensors; `None` for
/// all.
pub fn log_prior(reach: Reach, chosen: Option<usize>, sensors: usize) -> f64 {
    let Some(chosen) = chosen.filter(|_| sensors >= 2) else {
        return if reach == Reach::Any && sensors >= 2 { -(3.0_f64.ln()) } else { 0.0 };
    };
    let sets = ln_binomial(sensors as u64, chosen as u64);
    match reach {
        Reach::Single => -sets,
        Reach::Any | Reach::Whole if chosen == 1 => -(3.0_f64.ln()) - sets,
        Reach::Any | Reach::Whole => -(3.0_f64.ln()) - ((sensors.max(4) - 2) as f64).ln() - sets,
    }
}
