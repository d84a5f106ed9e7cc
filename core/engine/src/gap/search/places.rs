//! Sets of sensors improved by refits.
//!
//! The [screening](super::subsets) of sets assumes that the response changes in proportion to the size of an effect. An
//! effect that does not, such as saturation, may act on another set than the one of largest score. The best placements
//! are therefore moved to neighbouring sets, which have one sensor more or less, as long as the evidence rises. A move is
//! proposed by the misfit that it leaves when the unknowns adapt along their slopes, and judged after a refit.

use lacuna::math::random::Stream;
use lacuna::plugin::effect::{On, Reach};
use lacuna_linalg::Matrix;

use super::forward::Search;
use super::refit::{RefitSetting, Weighed};
use super::state::SearchState;
use super::subsets::{members, place_of};
use crate::gap::candidates::Placement;
use crate::gap::system::fit::{Fit, fit};
use crate::gap::test::Projection;

/// The number of types whose best placements are moved.
const TYPES: usize = 3;

/// The number of neighbours of a set that are refitted.
const TRIED: usize = 2;

/// The largest number of moves of a placement.
const MOVES: usize = 12;

/// The smallest gain in log weight of a move.
const GAIN: f64 = 0.1;

/// A set of sensors with the best fit on it.
struct Moved {
    members: u128,
    fit: Fit,
    log_weight: f64,
}

impl<'a> Search<'a> {
    /// Adds to weighed placements those to which the best ones of the first types move.
    pub(super) fn move_places(
        &self,
        state: &SearchState<'a>,
        weighed: &mut Vec<Weighed>,
        stream: &Stream,
    ) {
        let count = self.sensors.len();
        if !(2..=128).contains(&count) || self.sensors.iter().any(|on| on.len() != 1) {
            return;
        }
        let mut kinds: Vec<&str> = Vec::new();
        let mut seeds: Vec<Weighed> = Vec::new();
        for one in &*weighed {
            let candidate = &self.candidates[one.placement.candidate];
            let is_new = !kinds.contains(&candidate.kind.as_str());
            if is_new && kinds.len() < TYPES {
                kinds.push(&candidate.kind);
                let moves = candidate.effect.reach() == Reach::Any
                    && candidate.effect.switches().is_empty();
                seeds.extend(moves.then(|| one.clone()));
            }
        }
        let common = self.setting();
        let setting = state.refit_setting(&common);
        for (i, seed) in seeds.iter().enumerate() {
            let Some(moved) = self.moved(&setting, seed) else { continue };
            let on = place_of(&self.sensors, moved.members);
            let placement = Placement { candidate: seed.placement.candidate, on };
            let known = weighed.iter().position(|j| j.placement.is(&placement));
            let system = setting.with(&placement);
            let evidence = setting.weigh(&system, &moved.fit, &stream.named("moved").at(i as u64));
            let log_weight = evidence.value + setting.log_prior(&placement);
            match known {
                // An evidence that is known comes from a fit from several starts.
                Some(known) if weighed[known].log_weight >= log_weight => {}
                known => {
                    if let Some(known) = known {
                        weighed.remove(known);
                    }
                    let (score, absorbed) = (seed.score, seed.absorbed);
                    let (fit, gap) = (moved.fit, evidence.gap);
                    weighed.push(Weighed { placement, score, absorbed, fit, log_weight, gap });
                }
            }
        }
        weighed.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
    }

    /// The set of largest weight that is reached from a placement by moves; `None` if it stays.
    fn moved(&self, setting: &RefitSetting<'a, '_>, seed: &Weighed) -> Option<Moved> {
        let first = members(&self.sensors, &seed.placement.on)?;
        let log_weight = setting.glance(&seed.placement, &seed.fit)?;
        let mut here = Moved { members: first, fit: seed.fit.clone(), log_weight };
        for _ in 0..MOVES {
            let neighbours = self.neighbours(setting, seed.placement.candidate, &here);
            let tried = neighbours.into_iter().take(TRIED);
            let refitted = tried.filter_map(|members| {
                let on = place_of(&self.sensors, members);
                let placement = Placement { candidate: seed.placement.candidate, on };
                let system = setting.with(&placement);
                let fit = fit(&system, setting.whitener, setting.means, &here.fit.at.point);
                let log_weight = setting.glance(&placement, &fit)?;
                Some(Moved { members, fit, log_weight })
            });
            let best = refitted.max_by(|a, b| a.log_weight.total_cmp(&b.log_weight));
            match best {
                Some(next) if next.log_weight > here.log_weight + GAIN => here = next,
                _ => break,
            }
        }
        (here.members != first).then_some(here)
    }

    /// The sets with one sensor more or less, in increasing order of the misfit that they leave when the unknowns adapt
    /// along the slopes of the present fit.
    fn neighbours(
        &self,
        setting: &RefitSetting<'a, '_>,
        candidate: usize,
        here: &Moved,
    ) -> Vec<u128> {
        let on = place_of(&self.sensors, here.members);
        let system = setting.with(&Placement { candidate, on });
        let everywhere = setting.with(&Placement { candidate, on: On::new() });
        let point = &here.fit.at.point;
        let with = everywhere.response(point);
        let without = setting.system.response(&point[..setting.system.dimension()]);
        let count = self.sensors.len();
        let sets: Vec<u128> = (0..count).map(|k| here.members ^ (1 << k)).collect();
        let misfits = self.sensors.iter().enumerate().map(|(k, sensor)| -> Vec<f64> {
            let is_member = here.members >> k & 1 == 1;
            let changed = if is_member { &without } else { &with };
            let mut response = here.fit.at.response.clone();
            self.outputs_of(sensor).for_each(|i| response[i] = changed[i]);
            setting.means.iter().zip(response).map(|(y, m)| y - m).collect()
        });
        let white = setting.whitener.whiten_rows(&Matrix::from_rows(setting.means.len(), misfits));
        let (_, squares) = Projection::of(&system, &here.fit).rest_of_rows(white);
        let mut order: Vec<usize> = (0..count).filter(|&k| sets[k] != 0).collect();
        order.retain(|&k| squares[k].is_finite());
        order.sort_by(|&a, &b| squares[a].total_cmp(&squares[b]));
        order.into_iter().map(|k| sets[k]).collect()
    }
}
