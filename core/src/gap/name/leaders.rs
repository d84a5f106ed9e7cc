//! The candidates with the largest scores, refitted together with what is calibrated already.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::evidence::weigh;
use super::placement::log_prior;
use crate::gap::candidates::{Candidate, Suspect};
use crate::gap::fit::{Fit, fit_from};
use crate::gap::locate::{Directions, Projection, Scores};
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::effect::Situation;

/// The number of suspects that are refitted at least.
const LEADERS: usize = 10;

/// Suspects are refitted too whose squared score is less than this below the best.
const WITHIN: f64 = 10.0;

/// The most suspects that are refitted.
const MOST: usize = 24;

/// The best directions of a suspect give starts with the sizes that their scores estimate.
const SCORED: usize = 8;

/// Starts of a refit, of all those that a suspect has: the nearest to the data.
const STARTS: usize = 3;

/// A suspect with its best fit.
#[derive(Clone)]
pub struct Judged {
    /// The suspect.
    pub suspect: Suspect,
    /// The largest of its scores.
    pub score: f64,
    /// The share of it that the calibrated unknowns absorb.
    pub absorbed: f64,
    /// The fit with it.
    pub fit: Fit,
    /// The log of evidence times prior mass.
    pub log_weight: f64,
}

/// What a refit works with.
#[derive(Clone, Copy)]
pub struct Desk<'a, 'b> {
    /// What is calibrated already.
    pub system: &'b System<'a>,
    /// The candidates.
    pub candidates: &'a [Candidate],
    /// Made of the noise.
    pub whitener: &'b Whitener,
    /// The replicates' means.
    pub means: &'b [f64],
    /// The number of sensors.
    pub sensors: usize,
}

/// A suspect with the directions that scored best.
#[derive(Clone)]
pub struct Lead {
    /// The suspect.
    pub suspect: Suspect,
    /// Its largest score.
    pub score: f64,
    /// What of it is absorbed.
    pub absorbed: f64,
    /// Where its refit starts.
    pub starts: Vec<Vec<f64>>,
}

/// The suspects worth a refit, the best first; of every candidate at least the best place when it is near.
pub fn leads(
    suspects: &[Suspect],
    candidates: &[Candidate],
    directions: &Directions,
    scores: &Scores,
    situation: &Situation<'_>,
) -> Vec<Lead> {
    let mut by_suspect: BTreeMap<usize, Vec<(f64, usize)>> = BTreeMap::new();
    for (j, direction) in directions.all.iter().enumerate() {
        let strength = direction.strength(scores.values[j]);
        by_suspect.entry(direction.suspect).or_default().push((strength, j));
    }
    let layout = &situation.layouts.blocks[0];
    let mut leads: Vec<Lead> = Vec::new();
    for (suspect, mut own) in by_suspect {
        own.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let effect = &candidates[suspects[suspect].candidate].effect;
        let absent = effect.absent(layout)[0];
        let starts = own.iter().take(SCORED).map(|&(_, j)| {
            let mut start = directions.all[j].start.clone();
            // A step of the size that the score itself estimates.
            start[0] = absent + scores.values[j] / directions.all[j].length;
            start
        });
        let given = effect.starts(layout, situation);
        leads.push(Lead {
            suspect: suspects[suspect].clone(),
            score: own[0].0,
            absorbed: directions.all[own[0].1].absorbed,
            starts: starts.chain(given).collect(),
        });
    }
    leads.sort_by(|a, b| b.score.total_cmp(&a.score));
    let best = leads.first().map_or(0.0, |lead| lead.score);
    let near =
        |(i, lead): (usize, &Lead)| i < LEADERS || lead.score.powi(2) > best.powi(2) - WITHIN;
    let count = leads.iter().enumerate().take_while(|(i, lead)| near((*i, lead))).count();
    leads.truncate(count.min(MOST));
    leads
}

/// The leads refitted and weighed, the heaviest first.
pub fn judge(desk: &Desk<'_, '_>, base: &Fit, leads: &[Lead], stream: &Stream) -> Vec<Judged> {
    let mut judged: Vec<Judged> = leads
        .par_iter()
        .enumerate()
        .filter_map(|(i, lead)| one(desk, base, lead, &stream.at(i as u64)))
        .collect();
    judged.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
    judged
}

/// One lead refitted from all its starts, with the calibrated unknowns from where they are.
pub fn one(desk: &Desk<'_, '_>, base: &Fit, lead: &Lead, stream: &Stream) -> Option<Judged> {
    let system = desk.with(&lead.suspect);
    let bounds = system.bounds();
    let begin = base.at.point.len();
    let clamped = lead.starts.iter().map(|own| -> Vec<f64> {
        own.iter().zip(&bounds[begin..]).map(|(x, (lo, hi))| x.clamp(*lo, *hi)).collect()
    });
    let starts = desk.nearest(base, &lead.suspect, clamped.collect());
    let starts: Vec<Vec<f64>> =
        starts.iter().map(|own| base.at.point.iter().chain(own).copied().collect()).collect();
    let fit = fit_from(&system, desk.whitener, desk.means, &starts)?;
    let weighed = weigh(&system, desk.whitener, desk.means, &fit, stream);
    Some(Judged {
        suspect: lead.suspect.clone(),
        score: lead.score,
        absorbed: lead.absorbed,
        log_weight: weighed.log_evidence + desk.log_prior(&lead.suspect),
        fit,
    })
}

impl<'a> Desk<'a, '_> {
    /// The system with a suspect added.
    pub fn with(&self, suspect: &Suspect) -> System<'a> {
        let kind = &self.candidates[suspect.candidate].kind;
        let taken = |name: &str| self.system.effects.iter().any(|e| e.name == name);
        let mut name = kind.clone();
        let mut count = 1;
        while taken(&name) {
            count += 1;
            name = format!("{kind}_{count}");
        }
        self.system.with(suspect.placed(self.system.experiment, self.candidates, &name))
    }

    /// The starts of a suspect's parameters whose responses come nearest to the data when the calibrated unknowns follow
    /// along their slopes.
    fn nearest(&self, base: &Fit, suspect: &Suspect, starts: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        if starts.len() <= STARTS {
            return starts;
        }
        let placed = suspect.placed(self.system.experiment, self.candidates, "");
        let responses: Vec<Vec<f64>> = if placed.effect.switches().is_empty() {
            starts.iter().map(|start| placed.apply(&base.at.response, start)).collect()
        } else {
            let point = |start: &Vec<f64>| [&base.at.point[..], start].concat();
            self.with(suspect).responses(&starts.iter().map(point).collect::<Vec<_>>())
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

    /// The log prior mass of a suspect: its place's, and its share of its type's.
    pub fn log_prior(&self, suspect: &Suspect) -> f64 {
        let candidate = &self.candidates[suspect.candidate];
        let versions = self.candidates.iter().filter(|c| c.kind == candidate.kind).count();
        let chosen = (!suspect.on.is_empty()).then(|| chosen(suspect));
        log_prior(candidate.effect.reach(), chosen, self.sensors) - (versions as f64).ln()
    }
}

/// The number of sensors that a suspect acts on, by the labels of its place.
fn chosen(suspect: &Suspect) -> usize {
    suspect.on.values().map(Vec::len).product()
}
