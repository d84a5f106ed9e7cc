//! Groups of sensors that share an effect: found by growing from one, not by trying all.

use super::leaders::{Desk, Judged, Lead, one};
use crate::gap::candidates::Suspect;
use crate::gap::fit::Fit;
use crate::math::random::Stream;
use crate::plugin::effect::{On, Reach};

/// The best group of a judged suspect that acts on one sensor: the sensor is added that raises the weight most, as long
/// as one does. `others` are the sensors that the same candidate was judged or scored on, the strongest first.
pub fn grow(
    desk: &Desk<'_, '_>,
    base: &Fit,
    seed: &Judged,
    others: &[On],
    stream: &Stream,
) -> Judged {
    let candidate = &desk.candidates[seed.suspect.candidate];
    let mut best = seed.clone();
    if candidate.effect.reach() != Reach::Any || seed.suspect.on.len() != 1 {
        return best;
    }
    let begin = base.at.point.len();
    for (round, on) in others.iter().enumerate() {
        let Some(union) = union(&best.suspect.on, on) else { continue };
        let own = best.fit.at.point[begin..].to_vec();
        let lead = Lead {
            suspect: Suspect { candidate: seed.suspect.candidate, on: union },
            score: best.score,
            absorbed: best.absorbed,
            starts: vec![own],
        };
        let Some(next) = one(desk, base, &lead, &stream.at(round as u64)) else { continue };
        if next.log_weight > best.log_weight {
            best = next;
        }
    }
    best
}

/// Two places along one axis together; `None` when the second adds nothing.
fn union(on: &On, other: &On) -> Option<On> {
    let (axis, labels) = on.iter().next()?;
    let added = other.get(axis)?.iter().filter(|label| !labels.contains(label));
    let all: Vec<String> = labels.iter().chain(added).cloned().collect();
    (all.len() > labels.len()).then(|| On::from([(axis.clone(), all)]))
}
