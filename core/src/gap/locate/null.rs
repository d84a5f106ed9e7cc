//! The three statistics, and what they are when nothing is missing: by parametric bootstrap.
//!
//! Replicates are simulated from the fitted model, noise and common errors; the noise is estimated from them anew, the
//! model is calibrated to them anew (a step along its slopes), and the statistics are computed as for the data.

use rayon::prelude::*;

use super::projection::Projection;
use super::scan::{Cell, Scan};
use super::score::{Directions, Scores, differences};
use crate::gap::experiment::Experiment;
use crate::gap::fit::{Fit, precision};
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::linalg::Matrix;
use crate::math::random::{Stream, normal};

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
        let largest =
            |cells: &mut dyn Iterator<Item = f64>| cells.fold(f64::NEG_INFINITY, f64::max);
        let null: Vec<f64> =
            self.cells.iter().map(|cells| largest(&mut cells.iter().copied())).collect();
        probability(&null, largest(&mut statistics.cells.iter().map(|cell| cell.statistic)))
    }

    /// The probability of the energy.
    pub fn of_energy(&self, statistics: &Statistics) -> f64 {
        probability(&self.energy, statistics.energy)
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
        let scores = self.directions.scores(&left, &white, &spread);
        let cells = self.scan.best(&left);
        let energy = left.iter().map(|z| z * z).sum();
        Statistics { scores, cells, energy, left }
    }

    /// The statistics of `count` simulations.
    pub fn nulls(&self, count: usize, stream: &Stream) -> Nulls {
        let simulations: Vec<(f64, Vec<f64>, f64)> =
            (0..count).into_par_iter().map(|b| self.simulation(&stream.at(b as u64))).collect();
        let mut nulls = Nulls::default();
        for (score, cells, energy) in simulations {
            nulls.score.push(score);
            nulls.cells.push(cells);
            nulls.energy.push(energy);
        }
        nulls
    }

    fn simulation(&self, stream: &Stream) -> (f64, Vec<f64>, f64) {
        let response = &self.fit.at.response;
        let experiment = self.experiment();
        let replicates = self.noise.simulate(experiment, response, stream);
        let simulated = experiment.with_replicates(replicates);
        let error = common_error(experiment, self.noise, &stream.named("common"));
        let (_, means) = simulated.means();
        let misfit: Vec<f64> =
            (0..means.len()).map(|i| means[i] - response[i] + error[i]).collect();
        let left = self.projection.rest(&self.whitener.whiten(&misfit));
        let (rows, spread) = differences(&simulated);
        let scores = self.directions.scores(&left, &self.whitener.whiten_rows(&rows), &spread);
        let noise = Noise::of(&simulated, response, Some(self.noise));
        let whitener = Whitener::new(&simulated, &noise, response);
        let slopes = whitener.whiten_rows(&self.fit.at.tangents);
        let precisions: Vec<f64> = self.system.priors().iter().map(precision).collect();
        let left = Projection::off(&slopes, &precisions).rest(&whitener.whiten(&misfit));
        let cells = self.scan.best(&left).into_iter().map(|cell| cell.statistic).collect();
        (scores.largest(self.directions), cells, left.iter().map(|z| z * z).sum())
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
