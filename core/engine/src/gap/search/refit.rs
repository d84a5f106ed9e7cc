//! The placements with the largest scores, refitted together with the calibrated unknowns; groups of sensors.

use std::collections::BTreeMap;

use lacuna::math::random::Stream;
use lacuna::plugin::effect::Situation;
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::evidence::log_evidence;
use super::placement_prior::placement_prior;
use crate::gap::candidates::{Candidate, Placement};
use crate::gap::system::System;
use crate::gap::system::fit::{Begun, Fit};
use crate::gap::system::remainder::{Evidences, Setting, WhiteRemainder};
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{DesignMatrix, Projection, Scores};

/// The smallest number of placements that are refitted.
const FEWEST: usize = 10;

/// Placements whose squared score is less than this below the largest are refitted too.
const WITHIN: f64 = 10.0;

/// The largest number of placements that are refitted.
const MOST: usize = 24;

/// The smallest score with which the best placement of a type is refitted.
const VISIBLE: f64 = 3.0;

/// The number of regressors of a placement that give starts, with the sizes that their scores estimate.
const SCORED: usize = 8;

/// The number of starts of a refit: those nearest to the data.
const STARTS: usize = 3;

/// The log weight below the best that no fit under a remainder makes up for.
pub(super) const FAR: f64 = 30.0;

/// The log weight below the best from which a placement has no part in a probability that is printed, whatever the error
/// of Laplace's method.
const NEAR: f64 = 12.0;

/// A placement with its best fit.
#[derive(Clone)]
pub struct Weighed {
    /// The placement.
    pub placement: Placement,
    /// The largest of its studentised scores.
    pub score: f64,
    /// The share of its squared whitened length that the calibrated unknowns absorb.
    pub absorbed: f64,
    /// The fit of the system with it.
    pub fit: Fit,
    /// The log evidence plus the log prior mass.
    pub log_weight: f64,
    /// The energy of the gap that is left with it.
    pub gap: f64,
}

/// The evidence of a system with a remainder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TolerantEvidence {
    /// The log evidence, summed over the sizes of the remainder, up to the determinant of the noise.
    pub value: f64,
    /// The log Bayes factor of some remainder against none.
    pub inexact: f64,
    /// The energy of the gap that is left: see [`WhiteRemainder::energy`].
    pub gap: f64,
    /// The remainder of largest evidence; `None` for none.
    pub setting: Option<Setting>,
}

/// The calibrated system and everything that a refit with a further placement needs.
#[derive(Clone, Copy)]
pub struct RefitSetting<'a, 'b> {
    /// The system without the placement.
    pub system: &'b System<'a>,
    /// The candidates.
    pub candidates: &'a [Candidate],
    /// The whitener of the mean.
    pub whitener: &'b Whitener,
    /// The remainder in its coordinates.
    pub white: &'b WhiteRemainder,
    /// The replicates' means, one an output, in the response's unit.
    pub means: &'b [f64],
    /// The number of sensors.
    pub sensors: usize,
}

/// A placement with the regressors that scored best.
#[derive(Clone)]
pub struct Scored {
    /// The placement.
    pub placement: Placement,
    /// The largest of its studentised scores.
    pub score: f64,
    /// The share of its squared whitened length that the calibrated unknowns absorb.
    pub absorbed: f64,
    /// The starts of the effect's unknowns, in their units.
    pub starts: Vec<Vec<f64>>,
}

/// The placements of largest score, which are refitted, in decreasing order; among them `sets` of sensors.
pub fn most_promising(
    placements: &[Placement],
    candidates: &[Candidate],
    design: &DesignMatrix,
    scores: &Scores,
    situation: &Situation<'_>,
    sets: Vec<Scored>,
) -> Vec<Scored> {
    let mut by_placement: BTreeMap<usize, Vec<(f64, usize)>> = BTreeMap::new();
    for (j, regressor) in design.regressors.iter().enumerate() {
        let strength = regressor.strength(scores.values[j]);
        by_placement.entry(regressor.placement).or_default().push((strength, j));
    }
    let layout = &situation.layouts.blocks[0];
    let mut scored: Vec<Scored> = Vec::new();
    for (placement, mut own) in by_placement {
        own.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let effect = &candidates[placements[placement].candidate].effect;
        let absent = effect.absent(layout)[0];
        let starts = own.iter().take(SCORED).map(|&(_, j)| {
            let mut start = design.regressors[j].start.clone();
            // The start is the size that the score itself estimates.
            start[0] = absent + scores.values[j] / design.regressors[j].length;
            start
        });
        let given = effect.starts(layout, situation);
        scored.push(Scored {
            placement: placements[placement].clone(),
            score: own[0].0,
            absorbed: design.regressors[own[0].1].absorbed,
            starts: starts.chain(given).collect(),
        });
    }
    for set in sets {
        let same = |other: &&mut Scored| {
            let (a, b) = (&other.placement, &set.placement);
            a.candidate == b.candidate && a.on == b.on
        };
        match scored.iter_mut().find(same) {
            Some(known) => known.starts.extend(set.starts),
            None => scored.push(set),
        }
    }
    scored.sort_by(|a, b| b.score.total_cmp(&a.score));
    let best = scored.first().map_or(0.0, |scored| scored.score);
    let near =
        |(i, scored): (usize, &Scored)| i < FEWEST || scored.score.powi(2) > best.powi(2) - WITHIN;
    let count = scored.iter().enumerate().take_while(|(i, scored)| near((*i, scored))).count();
    let further = scored.split_off(count.min(MOST));
    // Each type has its best placement among them: a score says little of an effect that is not linear in its size.
    for one in further.into_iter().filter(|one| one.score >= VISIBLE) {
        let kind = |scored: &Scored| candidates[scored.placement.candidate].kind.as_str();
        if !scored.iter().any(|other| kind(other) == kind(&one)) {
            scored.push(one);
        }
    }
    scored
}

/// Refits placements and computes their evidences; the one of largest weight comes first. Every evidence is computed by
/// Laplace's method at the best fit; that of placements not far (30) below the best also at the fits under a
/// remainder, and of those near (12) it with the correction by importance sampling.
pub fn refit_all(
    setting: &RefitSetting<'_, '_>,
    base: &Fit,
    scored: &[Scored],
    stream: &Stream,
) -> Vec<Weighed> {
    let systems: Vec<System<'_>> =
        scored.iter().map(|scored| setting.with(&scored.placement)).collect();
    let mut fitted = setting.refitted(base, scored, &systems);
    let best = |fitted: &[Refitted<'_>]| {
        fitted.iter().map(|one| one.log_weight).fold(f64::NEG_INFINITY, f64::max)
    };
    let least = best(&fitted) - FAR;
    fitted.par_iter_mut().filter(|one| one.log_weight >= least).for_each(|one| {
        if let Some(grid) =
            setting.white.weigh(&one.system, setting.whitener, setting.means, &one.fit)
        {
            one.log_weight += grid.sum() - one.grid.sum();
            one.grid = grid;
        }
    });
    let least = best(&fitted) - NEAR;
    fitted.par_iter_mut().enumerate().filter(|(_, one)| one.log_weight >= least).for_each(
        |(i, one)| {
            let stream = stream.at(i as u64);
            let (whitener, means) = (setting.whitener, setting.means);
            let exact = log_evidence(&one.system, whitener, means, &one.fit, &stream);
            one.log_weight += exact.value - one.fit.log_evidence();
        },
    );
    let mut weighed: Vec<Weighed> = fitted.into_iter().map(|one| setting.weighed(one)).collect();
    weighed.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
    weighed
}

/// A placement with its best fit and its evidence by Laplace's method.
struct Refitted<'a> {
    scored: Scored,
    system: System<'a>,
    fit: Fit,
    grid: Evidences,
    log_weight: f64,
}

impl<'a> RefitSetting<'a, '_> {
    /// The evidence of a system at its best fit, with a remainder. The remainder is weighed by Laplace's method; what
    /// importance sampling corrects without a remainder is added.
    pub fn weigh(&self, system: &System<'_>, fit: &Fit, stream: &Stream) -> TolerantEvidence {
        let exact = log_evidence(system, self.whitener, self.means, fit, stream).value;
        let Some(grid) = self.white.weigh(system, self.whitener, self.means, fit) else {
            return TolerantEvidence { value: exact, inexact: 0.0, gap: 0.0, setting: None };
        };
        let setting = grid.best();
        TolerantEvidence {
            value: grid.sum() + exact - fit.log_evidence(),
            inexact: grid.inexact(),
            gap: self.white.energy(fit, setting),
            setting,
        }
    }

    /// Refits placements from their starts, with the calibrated unknowns from the fit `base`; `systems` have a placement
    /// each. Without those for which the forward map has no response, or whose fit is singular. Fits that are far below the
    /// best one are not accurate.
    fn refitted(&self, base: &Fit, scored: &[Scored], systems: &[System<'a>]) -> Vec<Refitted<'a>> {
        let refitted = |(i, fit): (usize, Fit)| {
            let grid = self.white.evidences(&fit)?;
            let (scored, system) = (scored[i].clone(), systems[i].clone());
            let log_weight = grid.sum() + self.log_prior(&scored.placement);
            Some(Refitted { scored, system, fit, grid, log_weight })
        };
        self.fits(base, scored, systems).into_par_iter().filter_map(refitted).collect()
    }

    /// The fits of placements by their indices, in ascending order. The one that is ahead after the first steps is finished
    /// first, to tell how near to it the others have to come.
    fn fits(&self, base: &Fit, scored: &[Scored], systems: &[System<'a>]) -> Vec<(usize, Fit)> {
        let begin = |(i, one): (usize, &Scored)| {
            let starts = self.starts(base, one, &systems[i]);
            Some((i, Begun::from(&systems[i], self.whitener, self.means, &starts)?))
        };
        let mut begun: Vec<(usize, Begun<'_, '_>)> =
            scored.par_iter().enumerate().filter_map(begin).collect();
        let leader = (0..begun.len()).max_by(|&a, &b| {
            begun[a].1.log_density().total_cmp(&begun[b].1.log_density()).then(b.cmp(&a))
        });
        let Some(leader) = leader else { return Vec::new() };
        let (first, ahead) = begun.remove(leader);
        let ahead = ahead.finished(f64::NEG_INFINITY);
        let of_interest = ahead.as_ref().map_or(f64::NEG_INFINITY, |fit| fit.log_density - FAR);
        let mut fits: Vec<(usize, Fit)> = begun
            .into_par_iter()
            .filter_map(|(i, begun)| Some((i, begun.finished(of_interest)?)))
            .collect();
        fits.extend(ahead.map(|fit| (first, fit)));
        fits.sort_by_key(|(i, _)| *i);
        self.fit_special_cases(scored, systems, &mut fits);
        fits
    }

    /// The starts of a placement with the calibrated unknowns from the fit `base`.
    fn starts(&self, base: &Fit, scored: &Scored, system: &System<'_>) -> Vec<Vec<f64>> {
        let bounds = system.bounds();
        let begin = base.at.point.len();
        let clamped = scored.starts.iter().map(|own| -> Vec<f64> {
            own.iter().zip(&bounds[begin..]).map(|(x, (lo, hi))| x.clamp(*lo, *hi)).collect()
        });
        let starts = self.nearest(base, &scored.placement, clamped.collect());
        starts.iter().flat_map(|own| self.joint(&base.at.point, &scored.placement, own)).collect()
    }

    /// The starts of a fit with a further placement: the calibrated unknowns as they are, and with the parameters that
    /// its candidate states, followed by its own unknowns.
    pub fn joint(&self, point: &[f64], placement: &Placement, own: &[f64]) -> Vec<Vec<f64>> {
        let beside = &self.candidates[placement.candidate].beside;
        let moved = (!beside.is_empty()).then(|| [&beside[..], &point[beside.len()..]].concat());
        std::iter::once(point.to_vec())
            .chain(moved)
            .map(|point| [&point[..], own].concat())
            .collect()
    }

    fn weighed(&self, one: Refitted<'_>) -> Weighed {
        Weighed {
            gap: self.white.energy(&one.fit, one.grid.best()),
            placement: one.scored.placement,
            score: one.scored.score,
            absorbed: one.scored.absorbed,
            log_weight: one.log_weight,
            fit: one.fit,
        }
    }

    /// The log evidence of a fit with a remainder, by Laplace's method at its point, plus the log prior mass of a
    /// placement: what [`RefitSetting::weigh`] gives without its corrections. `None` if the fit is singular.
    pub fn glance(&self, placement: &Placement, fit: &Fit) -> Option<f64> {
        Some(self.white.glance(fit)? + self.log_prior(placement))
    }

    /// The system with a further placement.
    pub fn with(&self, placement: &Placement) -> System<'a> {
        let kind = &self.candidates[placement.candidate].kind;
        let taken = |name: &str| self.system.effects.iter().any(|e| e.name == name);
        let mut name = kind.clone();
        let mut count = 1;
        while taken(&name) {
            count += 1;
            name = format!("{kind}_{count}");
        }
        self.system.with(placement.placed(self.system.experiment, self.candidates, &name))
    }

    /// The starts whose responses are nearest to the data when the calibrated unknowns adapt along their slopes.
    fn nearest(&self, base: &Fit, placement: &Placement, starts: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        if starts.len() <= STARTS {
            return starts;
        }
        let placed = placement.placed(self.system.experiment, self.candidates, "");
        let responses: Vec<Vec<f64>> = if placed.effect.switches().is_empty() {
            let point = self.system.parameters(&base.at.point);
            starts.iter().map(|start| placed.apply(&base.at.response, start, point)).collect()
        } else {
            let point = |start: &Vec<f64>| [&base.at.point[..], start].concat();
            self.with(placement).responses(&starts.iter().map(point).collect::<Vec<_>>())
        };
        let misfit = |response: Vec<f64>| -> Vec<f64> {
            self.means.iter().zip(response).map(|(y, m)| y - m).collect()
        };
        let misfits = Matrix::from_rows(self.means.len(), responses.into_iter().map(misfit));
        let white = self.whitener.whiten_rows(&misfits);
        let (_, squares) = Projection::of(self.system, base).rest_of_rows(white);
        let mut order: Vec<usize> = (0..starts.len()).filter(|&i| squares[i].is_finite()).collect();
        order.sort_by(|&a, &b| squares[a].total_cmp(&squares[b]));
        order.into_iter().take(STARTS).map(|i| starts[i].clone()).collect()
    }

    /// The log prior mass of a placement within its type.
    pub fn log_prior(&self, placement: &Placement) -> f64 {
        placement_prior(self.candidates, placement, self.sensors)
    }
}
