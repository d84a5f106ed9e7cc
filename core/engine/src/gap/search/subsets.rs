//! The sets of sensors on which a candidate may act, screened by their scores.
//!
//! The score of a set is linear in its sensors: with `b` the products of each sensor's own regressor with the residual
//! and `G` the Gram matrix of these regressors, both projected off the calibrated unknowns, the squared score of a set
//! `s` is `(1_s' b)^2 / (1_s' G 1_s)`. All sets are tried for up to twelve sensors; with more, sets grow and shrink by
//! one sensor from each single sensor, from all sensors and from all but one, as long as that helps.

use lacuna::plugin::effect::{On, Reach};
use lacuna_linalg::{Matrix, multiply_transposed, multiply_vector};

use super::placement_prior::log_prior;
use super::refit::Scored;
use crate::gap::candidates::{Candidate, Placement, place};
use crate::gap::experiment::Experiment;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{DesignMatrix, Projection};

/// The largest number of sensors of which all sets are tried.
const ALL: usize = 12;

/// The number of sets of a candidate that are kept.
const KEPT: usize = 3;

/// A set of sensors as bits, with its squared score penalised by its prior mass, and its size.
#[derive(Debug, Clone, Copy)]
struct Set {
    members: u128,
    merit: f64,
    square: f64,
    size: f64,
}

/// The setting of the screening.
pub(super) struct Screen<'a> {
    pub experiment: &'a Experiment<'a>,
    pub candidates: &'a [Candidate],
    pub placements: &'a [Placement],
    pub sensors: &'a [On],
    pub whitener: &'a Whitener,
    pub projection: &'a Projection,
    /// The whitened and projected residual.
    pub residual: &'a [f64],
}

impl Screen<'_> {
    /// The sets of largest score of each candidate that may act on any sensors, with the starts of its unknowns.
    pub fn best(&self, design: &DesignMatrix) -> Vec<Scored> {
        let count = self.sensors.len();
        // A set of sensors along several axes is not a product of labels.
        if !(2..=128).contains(&count) || self.sensors.iter().any(|on| on.len() != 1) {
            return Vec::new();
        }
        let masks: Vec<Vec<bool>> = self.sensors.iter().map(|on| self.mask(on)).collect();
        let mut all = Vec::new();
        for (c, candidate) in self.candidates.iter().enumerate() {
            if candidate.effect.reach() != Reach::Any {
                continue;
            }
            let mut found: Vec<(Set, Scored)> = Vec::new();
            for (j, regressor) in design.regressors.iter().enumerate() {
                let placement = &self.placements[regressor.placement];
                if placement.candidate != c || !placement.on.is_empty() {
                    continue;
                }
                let absent = candidate.effect.absent(&self.experiment.layouts.blocks[0])[0];
                for set in self.sets(design.change(j), &masks, regressor.sign) {
                    let mut start = regressor.start.clone();
                    start[0] = absent + set.size;
                    found.push((set, self.scored(c, set, start, regressor.absorbed)));
                }
            }
            found.sort_by(|a, b| b.0.merit.total_cmp(&a.0.merit));
            let mut kept: Vec<u128> = Vec::new();
            for (set, scored) in found {
                if let Some(known) = kept.iter().position(|members| *members == set.members) {
                    let first = all.len() - kept.len();
                    let known: &mut Scored = &mut all[first + known];
                    known.starts.extend(scored.starts);
                } else if kept.len() < KEPT {
                    kept.push(set.members);
                    all.push(scored);
                }
            }
        }
        all
    }

    /// The outputs of a sensor.
    fn mask(&self, on: &On) -> Vec<bool> {
        let mut mask = vec![false; self.experiment.outputs()];
        for curve in self.experiment.curves.iter().filter(|curve| place(curve) == *on) {
            curve.measured.iter().for_each(|&i| mask[i] = true);
        }
        mask
    }

    fn scored(&self, candidate: usize, set: Set, start: Vec<f64>, absorbed: f64) -> Scored {
        let placement = Placement { candidate, on: place_of(self.sensors, set.members) };
        Scored { placement, score: set.square.sqrt(), absorbed, starts: vec![start] }
    }

    /// The sets of largest merit for the derivative of the response by the size of an effect on all sensors.
    fn sets(&self, change: &[f64], masks: &[Vec<bool>], sign: f64) -> Vec<Set> {
        let own = masks.iter().map(|mask| -> Vec<f64> {
            change.iter().zip(mask).map(|(x, on)| if *on { *x } else { 0.0 }).collect()
        });
        let white = self.whitener.whiten_rows(&Matrix::from_rows(change.len(), own));
        let (left, _) = self.projection.rest_of_rows(white.clone());
        let gram = multiply_transposed(&left, &white);
        let products = multiply_vector(&left, self.residual);
        let merit = |members: u128| {
            let chosen: Vec<usize> = (0..masks.len()).filter(|k| members >> k & 1 == 1).collect();
            let product: f64 = chosen.iter().map(|&k| products[k]).sum();
            let row = |&i: &usize| chosen.iter().map(|&j| gram[(i, j)]).sum::<f64>();
            let square: f64 = chosen.iter().map(row).sum();
            self.set(members, product, square, sign)
        };
        let mut best = if masks.len() <= ALL {
            every(&gram, &products, |members, product, square| {
                self.set(members, product, square, sign)
            })
        } else {
            climbed(masks.len(), merit)
        };
        best.sort_by(|a, b| b.merit.total_cmp(&a.merit));
        best.truncate(KEPT);
        best
    }

    fn set(&self, members: u128, product: f64, square: f64, sign: f64) -> Set {
        let allowed = sign == 0.0 || product * sign > 0.0;
        let score = if allowed && square > 0.0 { product * product / square } else { 0.0 };
        let count = members.count_ones() as usize;
        let chosen = (count < self.sensors.len()).then_some(count);
        let prior = log_prior(Reach::Any, chosen, self.sensors.len());
        let size = if square > 0.0 { product / square } else { 0.0 };
        Set { members, merit: 0.5 * score + prior, square: score, size }
    }
}

/// The place of a set of sensors along one axis.
pub(super) fn place_of(sensors: &[On], members: u128) -> On {
    let mut on = On::new();
    if (members.count_ones() as usize) < sensors.len() {
        let chosen = (0..sensors.len()).filter(|k| members >> k & 1 == 1);
        for (axis, labels) in chosen.flat_map(|k| &sensors[k]) {
            on.entry(axis.clone()).or_default().extend(labels.iter().cloned());
        }
    }
    on
}

/// The set of the sensors of a place; `None` if the place is not a set of them.
pub(super) fn members(sensors: &[On], on: &On) -> Option<u128> {
    if on.is_empty() {
        return (sensors.len() <= 128).then(|| u128::MAX >> (128 - sensors.len()));
    }
    let contains = |sensor: &On| {
        let named = |(axis, own): (&String, &Vec<String>)| {
            on.get(axis).is_some_and(|labels| own.iter().all(|label| labels.contains(label)))
        };
        sensor.len() == on.len() && sensor.iter().all(named)
    };
    let members = (0..sensors.len()).filter(|&k| contains(&sensors[k]));
    let members = members.fold(0, |all, k| all | 1 << k);
    (members != 0).then_some(members)
}

/// All sets, in the order of Gray's code, so that each differs from the one before by one sensor.
fn every(gram: &Matrix, products: &[f64], set: impl Fn(u128, f64, f64) -> Set) -> Vec<Set> {
    let count = products.len();
    let mut inside = vec![false; count];
    let (mut members, mut product, mut square) = (0_u128, 0.0, 0.0);
    let mut best: Vec<Set> = Vec::new();
    for step in 1_u64..1 << count {
        let k = step.trailing_zeros() as usize;
        let with: f64 = (0..count).filter(|&j| inside[j] && j != k).map(|j| gram[(k, j)]).sum();
        let sign = if inside[k] { -1.0 } else { 1.0 };
        inside[k] = !inside[k];
        members ^= 1 << k;
        product += sign * products[k];
        square += sign * (gram[(k, k)] + 2.0 * with);
        let one = set(members, product, square);
        let worst = best.last().map_or(f64::NEG_INFINITY, |s| s.merit);
        if best.len() < KEPT || one.merit > worst {
            best.push(one);
            best.sort_by(|a, b| b.merit.total_cmp(&a.merit));
            best.truncate(KEPT);
        }
    }
    best
}

/// Local maxima over sets that differ by one sensor.
fn climbed(count: usize, merit: impl Fn(u128) -> Set) -> Vec<Set> {
    let all = if count == 128 { u128::MAX } else { (1 << count) - 1 };
    let singles = (0..count).map(|k| 1_u128 << k);
    let starts = singles.clone().chain(singles.map(|one| all ^ one)).chain([all]);
    let mut best: Vec<Set> = Vec::new();
    for start in starts.filter(|members| *members != 0) {
        let mut now = merit(start);
        loop {
            let next = (0..count)
                .map(|k| now.members ^ (1 << k))
                .filter(|members| *members != 0)
                .map(&merit)
                .max_by(|a, b| a.merit.total_cmp(&b.merit));
            match next {
                Some(next) if next.merit > now.merit => now = next,
                _ => break,
            }
        }
        if !best.iter().any(|s| s.members == now.members) {
            best.push(now);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensors(count: usize) -> Vec<On> {
        (0..count).map(|k| On::from([("sensor".to_owned(), vec![format!("s{k}")])])).collect()
    }

    #[test]
    fn a_set_is_a_place_and_back() {
        let sensors = sensors(5);
        for set in 1_u128..32 {
            let on = place_of(&sensors, set);
            assert_eq!(on.is_empty(), set == 31);
            assert_eq!(members(&sensors, &on), Some(set));
        }
        assert_eq!(members(&sensors, &On::from([("other".to_owned(), vec!["s1".into()])])), None);
    }

    /// Sums over members are the definition; the order of Gray's code must not change them.
    #[test]
    fn all_sets_have_the_sums_of_their_members() {
        let count = 5;
        let gram = Matrix::from_fn(count, count, |i, j| {
            if i == j { 2.0 + i as f64 } else { 0.1 * (i + j) as f64 }
        });
        let products = [1.0, -2.0, 0.5, 3.0, 0.1];
        let seen = std::cell::RefCell::new(vec![false; 1 << count]);
        every(&gram, &products, |members, product, square| {
            let own: Vec<usize> = (0..count).filter(|k| members >> k & 1 == 1).collect();
            let sum: f64 = own.iter().map(|&k| products[k]).sum();
            let all: f64 =
                own.iter().flat_map(|&i| own.iter().map(move |&j| (i, j))).map(|ij| gram[ij]).sum();
            assert!((product - sum).abs() < 1e-12 && (square - all).abs() < 1e-12);
            seen.borrow_mut()[members as usize] = true;
            Set { members, merit: sum, square, size: 0.0 }
        });
        assert_eq!(seen.borrow().iter().filter(|seen| **seen).count(), (1 << count) - 1);
    }
}
