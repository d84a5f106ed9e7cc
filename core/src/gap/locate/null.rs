//! The three statistics, and what they are when nothing is missing: by parametric bootstrap.
//!
//! Replicates are simulated from the fitted model, noise and common errors; the noise is estimated from them anew, the
//! model is calibrated to them anew (a step along its slopes), and the statistics are computed as for the data.

use std::ops::Range;

use rayon::prelude::*;

use super::projection::Projection;
use super::scan::{Cell, Scan};
use super::score::{Directions, Scores, Spread, differences};
use crate::gap::experiment::Experiment;
use crate::gap::fit::{Fit, precision};
use crate::gap::noise::{Around, Noise};
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::linalg::Matrix;
use crate::linalg::vector::dot;
use crate::math::random::{Stream, normal};

/// Simulations between two looks at whether there are enough.
const ROUND: usize = 50;

/// Simulations whose scores are taken together.
const CHUNK: usize = 5;

/// Directions whose scores are taken through the noise of a simulation: those that score most through that of the data. The
/// largest is among them but for differences between the two noises.
const STRONGEST: usize = 40;

/// A statistic that so many simulations reach is not rare.
const ENOUGH: usize = 10;

/// What the tests look at.
#[derive(Debug, Clone)]
pub struct Statistics {
    /// The studentised score of each direction.
    pub scores: Scores,
    /// The best cell of each place that is scanned.
    pub cells: Vec<Cell>,
    /// The energy of the whole residual.
    pub energy: f64,
    /// The whitened residual, off the slopes of the calibrated unknowns.
    pub left: Vec<f64>,
}

/// The statistics of simulated data without any missing effect, one entry a simulation.
#[derive(Debug, Clone, Default)]
pub struct Nulls {
    /// The largest score.
    pub score: Vec<f64>,
    /// The best cell of each place.
    pub cells: Vec<Vec<f64>>,
    /// The energy.
    pub energy: Vec<f64>,
}

/// The statistics of one simulation.
struct Drawn {
    score: f64,
    cells: Vec<f64>,
    energy: f64,
}

/// The probability of such a value or a larger one under the null.
pub fn probability(null: &[f64], value: f64) -> f64 {
    let above = null.iter().filter(|x| **x >= value).count();
    (above + 1) as f64 / (null.len() + 1) as f64
}

impl Nulls {
    /// The probability of the largest score.
    pub fn of_score(&self, statistics: &Statistics, directions: &Directions) -> f64 {
        probability(&self.score, statistics.scores.largest(directions))
    }

    /// The probability of the best cell of all.
    pub fn of_scan(&self, statistics: &Statistics) -> f64 {
        probability(&self.best_cells(), statistics.best_cell())
    }

    /// The probability of the energy.
    pub fn of_energy(&self, statistics: &Statistics) -> f64 {
        probability(&self.energy, statistics.energy)
    }

    fn best_cells(&self) -> Vec<f64> {
        let best = |cells: &Vec<f64>| cells.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        self.cells.iter().map(best).collect()
    }

    /// Whether none of the statistics of the data is rare.
    fn settled(&self, data: &Statistics, directions: &Directions) -> bool {
        let reached = |null: &[f64], value: f64| null.iter().filter(|x| **x >= value).count();
        reached(&self.energy, data.energy) >= ENOUGH
            && reached(&self.score, data.scores.largest(directions)) >= ENOUGH
            && reached(&self.best_cells(), data.best_cell()) >= ENOUGH
    }
}

impl Statistics {
    fn best_cell(&self) -> f64 {
        self.cells.iter().map(|cell| cell.statistic).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// A calibrated system with all that its statistics need.
pub struct Bench<'a> {
    /// The system.
    pub system: &'a System<'a>,
    /// Its best fit.
    pub fit: &'a Fit,
    /// The noise of its replicates.
    pub noise: &'a Noise,
    /// Made of the noise.
    pub whitener: &'a Whitener,
    /// Off the slopes of the fit.
    pub projection: &'a Projection,
    /// What may be missing.
    pub directions: &'a Directions,
    /// What is scanned.
    pub scan: &'a Scan,
}

impl Bench<'_> {
    fn experiment(&self) -> &Experiment<'_> {
        self.system.experiment
    }

    /// The statistics of the data.
    pub fn statistics(&self) -> Statistics {
        let left = self.projection.rest(&self.fit.residual);
        let (rows, spread) = differences(self.experiment());
        let white = self.whitener.whiten_rows(&rows);
        let scores = self.directions.scores_of(&left, &white, &spread);
        let cells = self.scan.best(&left);
        let energy = left.iter().map(|z| z * z).sum();
        Statistics { scores, cells, energy, left }
    }

    /// The statistics of at most `count` simulations: fewer where all three statistics of the data have been reached so
    /// often that none of them is rare (Besag and Clifford, Biometrika 78 (1991) 301).
    pub fn nulls(&self, data: &Statistics, count: usize, stream: &Stream) -> Nulls {
        let mut nulls = Nulls::default();
        let around = Around::fit(self.system, &self.fit.at);
        while nulls.energy.len() < count && !nulls.settled(data, self.directions) {
            let begin = nulls.energy.len();
            let end = count.min(begin + ROUND);
            let chunks: Vec<usize> = (begin..end).step_by(CHUNK).collect();
            let drawn: Vec<Vec<Drawn>> = chunks
                .par_iter()
                .map(|&first| self.simulations(first..end.min(first + CHUNK), &around, stream))
                .collect();
            for one in drawn.into_iter().flatten() {
                nulls.score.push(one.score);
                nulls.cells.push(one.cells);
                nulls.energy.push(one.energy);
            }
        }
        nulls
    }

    /// Some simulations, whose scores are one product of matrices.
    fn simulations(&self, numbers: Range<usize>, around: &Around, stream: &Stream) -> Vec<Drawn> {
        let experiment = self.experiment();
        let response = &self.fit.at.response;
        let (mut misfits, mut rows) =
            (Matrix::zeros(0, response.len()), Matrix::zeros(0, response.len()));
        let mut spread = Spread::default();
        let mut simulated = Vec::new();
        for b in numbers {
            let stream = stream.at(b as u64);
            let replicates = self.noise.simulate(experiment, response, &stream);
            let one = experiment.with_replicates(replicates);
            let error = common_error(experiment, self.noise, &stream.named("common"));
            let (_, means) = one.means();
            let misfit: Vec<f64> =
                (0..means.len()).map(|i| means[i] - response[i] + error[i]).collect();
            misfits.push_row(&misfit);
            let (own, of_one) = differences(&one);
            own.iter_rows().for_each(|row| rows.push_row(row));
            spread = of_one;
            simulated.push(one);
        }
        let (left, _) = self.projection.rest_of_rows(self.whitener.whiten_rows(&misfits));
        let scores = self.directions.scores(&left, &self.whitener.whiten_rows(&rows), &spread);
        let each = simulated.iter().zip(misfits.iter_rows()).zip(scores);
        each.map(|((one, misfit), scores)| self.drawn(one, misfit, &scores, around)).collect()
    }

    /// One simulation with its noise estimated anew; `near` are its scores through the noise of the data.
    fn drawn(
        &self,
        simulated: &Experiment<'_>,
        misfit: &[f64],
        near: &Scores,
        around: &Around,
    ) -> Drawn {
        let noise = Noise::of(simulated, around, Some(self.noise));
        let whitener = Whitener::new(simulated, &noise, &around.response);
        let slopes = whitener.whiten_rows(&self.fit.at.tangents);
        let precisions: Vec<f64> = self.system.priors().iter().map(precision).collect();
        let projection = Projection::off(&slopes, &precisions);
        let left = projection.rest(&whitener.whiten(misfit));
        // The noise of a record follows from its misfit and may be quite another.
        let count = if simulated.has_records() { usize::MAX } else { STRONGEST };
        let strongest = self.directions.strongest(near, count, simulated, &whitener, &projection);
        let (rows, spread) = differences(simulated);
        let scores = strongest.scores_of(&left, &whitener.whiten_rows(&rows), &spread);
        Drawn {
            score: scores.largest(&strongest),
            cells: self.scan.best(&left).into_iter().map(|cell| cell.statistic).collect(),
            energy: dot(&left, &left),
        }
    }
}

/// A draw of the errors that all replicates share.
pub fn common_error(experiment: &Experiment<'_>, noise: &Noise, stream: &Stream) -> Vec<f64> {
    let mut all = noise.remainder(experiment, &stream.named("remainder"));
    let mut rng = stream.generator();
    for error in &experiment.common {
        let draw: Vec<f64> = (0..error.factor.columns()).map(|_| normal(&mut rng)).collect();
        let drawn: Matrix = Matrix::from_vec(draw.len(), 1, draw);
        let moved = crate::linalg::multiply(&error.factor, &drawn);
        all.iter_mut().zip(moved.as_slice()).for_each(|(a, m)| *a += m);
    }
    all
}
