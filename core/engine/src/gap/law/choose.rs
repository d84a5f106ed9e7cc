//! The choice of a form: the responses to all forms along a run are compared with what is left of the data, in the metric
//! of the noise and off the slopes of the unknowns.

use std::ops::Range;

use lacuna::math::random::{Stream, permutation};
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::{dot, norm};
use rayon::prelude::*;

use super::force::Misfit;
use super::forms::Entry;
use crate::gap::experiment::Experiment;
use crate::gap::test::probability;
use crate::gap::unlisted::selection::{Blocks, Chosen, Metric};

/// The level at which the best form is better than the best form on noise alone.
const LEVEL: f64 = 0.05;

/// The number of simulations of noise alone.
const SIMULATIONS: usize = 99;

/// The number of forms that are refitted, each of another kind.
const FINALISTS: usize = 6;

/// A form whose gain is less than this share of the best one's is not refitted.
const NEAR: f64 = 0.5;

/// The number of starts of a refit on either side of a linear law, from exponents or thresholds of the dictionary.
const STARTS: usize = 2;

/// The number of random halves of the data.
const HALVES: usize = 50;

/// The number of blocks of a curve of which half are drawn.
const PARTS: usize = 10;

/// The number of forms that may win in a half.
const CONTENDERS: usize = 48;

/// The squared cosine of the responses to two forms above which they can hardly be told from each other.
const ALIKE: f64 = 0.98;

/// A form that keeps less than this share of its length off the slopes says nothing of its own.
const ABSORBED: f64 = 1e-4;

/// Forms with their whitened responses.
pub(super) struct Screen<'e> {
    entries: &'e [Entry],
    metric: Metric,
    /// The responses in units of their length, `forms x outputs`, and these lengths.
    rows: Matrix,
    scale: Vec<f64>,
    members: Vec<Vec<usize>>,
    misfit: Misfit,
    /// The residual in the metric.
    rest: Vec<f64>,
    values: usize,
}

/// A form that is worth a refit: the entries of one kind, the best first, with the coefficients that they have alone.
pub(super) struct Finalist {
    pub starts: Vec<(Entry, f64)>,
}

impl Finalist {
    /// True while there are few starts on the side of an entry: a fit does not cross the exponent one, where a power
    /// becomes what the parameters make up for.
    fn has_room_for(&self, entry: &Entry) -> bool {
        let there = self.starts.iter().filter(|(own, _)| own.is_steep() == entry.is_steep());
        there.count() < STARTS
    }
}

impl<'e> Screen<'e> {
    /// The screen of forms by their whitened responses, `forms x outputs`.
    pub fn new(entries: &'e [Entry], white: Matrix, misfit: Misfit, values: usize) -> Option<Self> {
        let metric = Metric::off(&misfit.slopes, &misfit.precisions)?;
        let (mut rows, mut scale) = (white, Vec::new());
        for a in 0..rows.rows() {
            let length = norm(rows.row(a));
            let free = norm(&metric.of(rows.row(a)));
            let counts =
                length.is_finite() && length > 0.0 && free * free > ABSORBED * length * length;
            scale.push(if counts { length } else { f64::INFINITY });
            rows.row_mut(a).iter_mut().for_each(|x| *x = if counts { *x / length } else { 0.0 });
        }
        let members = (0..rows.rows()).map(|a| vec![a]).collect();
        let rest = metric.of(&misfit.residual);
        Some(Self { entries, metric, rows, scale, members, misfit, rest, values })
    }

    /// The finalists, the best first; empty if no form is better than the best one on noise alone.
    pub fn finalists(&self, stream: &Stream) -> Vec<Finalist> {
        let blocks = Blocks::new(&self.metric, &self.rows, &self.members, self.values);
        let left = blocks.whole();
        let scores = blocks.scores(&self.rest);
        let mut all: Vec<Chosen> = blocks.each(&left, &scores, &self.rest).collect();
        all.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.block.cmp(&b.block)));
        let Some(best) = all.first() else { return Vec::new() };
        let largest: Vec<f64> = (0..SIMULATIONS)
            .into_par_iter()
            .map(|b| {
                let noise = self.metric.noise(&stream.at(b as u64));
                let best = blocks.best(&left, &blocks.scores(&noise), &noise);
                best.map_or(f64::NEG_INFINITY, |best| best.gain)
            })
            .collect();
        if probability(&largest, best.gain) > LEVEL {
            return Vec::new();
        }
        let mut finalists: Vec<Finalist> = Vec::new();
        for chosen in &all {
            let entry = &self.entries[chosen.block];
            let own = (entry.clone(), self.coefficient(chosen.block));
            let known = finalists.iter().position(|one| one.starts[0].0.is_kin(entry));
            if known.is_none() && chosen.gain < NEAR * best.gain {
                continue;
            }
            match known {
                Some(k) if finalists[k].has_room_for(entry) => finalists[k].starts.push(own),
                None if finalists.len() < FINALISTS => {
                    finalists.push(Finalist { starts: vec![own] });
                }
                _ => {}
            }
        }
        finalists
    }

    /// The coefficient of a form alone.
    fn coefficient(&self, a: usize) -> f64 {
        let row = self.rows.row(a);
        let free = self.metric.of(row);
        dot(row, &self.rest) / dot(row, &free) / self.scale[a]
    }

    /// The share of random halves of the data in which the best form is of the kind of `winner`, or can hardly be told from
    /// it.
    pub fn stability(&self, experiment: &Experiment<'_>, winner: &Entry, stream: &Stream) -> f64 {
        let parts = parts(experiment);
        let blocks = Blocks::new(&self.metric, &self.rows, &self.members, self.values);
        let scores = blocks.scores(&self.rest);
        let mut all: Vec<Chosen> = blocks.each(&blocks.whole(), &scores, &self.rest).collect();
        all.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.block.cmp(&b.block)));
        let contenders: Vec<usize> = all.iter().take(CONTENDERS).map(|one| one.block).collect();
        let own: Vec<usize> =
            contenders.iter().copied().filter(|&a| self.entries[a].is_kin(winner)).collect();
        let alike = |best: usize| {
            self.entries[best].is_kin(winner) || own.iter().any(|&a| self.alike(a, best) > ALIKE)
        };
        let wins = (0..HALVES).into_par_iter().filter(|b| {
            self.best_of_half(&parts, &contenders, &stream.at(*b as u64)).is_some_and(alike)
        });
        wins.count() as f64 / HALVES as f64
    }

    /// The squared cosine between the responses to two forms, off the slopes.
    fn alike(&self, a: usize, b: usize) -> f64 {
        let [x, y] = [a, b].map(|k| self.metric.of(self.rows.row(k)));
        let product = dot(self.rows.row(a), &y);
        let squares = dot(self.rows.row(a), &x) * dot(self.rows.row(b), &y);
        product * product / squares.max(f64::MIN_POSITIVE)
    }

    fn best_of_half(
        &self,
        parts: &[Vec<usize>],
        contenders: &[usize],
        stream: &Stream,
    ) -> Option<usize> {
        let order = permutation(&mut stream.generator(), parts.len());
        let mut kept = vec![false; self.rest.len()];
        let chosen = order.iter().take(parts.len().div_ceil(2));
        chosen.flat_map(|&p| &parts[p]).for_each(|&i| kept[i] = true);
        let masked = |rows: &Matrix, which: &[usize]| {
            Matrix::from_fn(which.len(), rows.columns(), |a, i| {
                if kept[i] { rows[(which[a], i)] } else { 0.0 }
            })
        };
        let all: Vec<usize> = (0..self.misfit.slopes.rows()).collect();
        let metric = Metric::off(&masked(&self.misfit.slopes, &all), &self.misfit.precisions)?;
        let rows = masked(&self.rows, contenders);
        let members: Vec<Vec<usize>> = (0..contenders.len()).map(|a| vec![a]).collect();
        let residual: Vec<f64> =
            (0..kept.len()).map(|i| if kept[i] { self.misfit.residual[i] } else { 0.0 }).collect();
        let rest = metric.of(&residual);
        let blocks = Blocks::new(&metric, &rows, &members, self.values);
        let best = blocks.best(&blocks.whole(), &blocks.scores(&rest), &rest)?;
        Some(contenders[best.block])
    }
}

/// The measured outputs of each block of each curve.
fn parts(experiment: &Experiment<'_>) -> Vec<Vec<usize>> {
    let of = |measured: &[usize]| -> Vec<Vec<usize>> {
        let count = PARTS.min(measured.len());
        let part = |k: usize| -> Range<usize> {
            k * measured.len() / count..(k + 1) * measured.len() / count
        };
        (0..count).map(|k| measured[part(k)].to_vec()).collect()
    };
    experiment.curves.iter().flat_map(|curve| of(&curve.measured)).collect()
}
