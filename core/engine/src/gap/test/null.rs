//! The three test statistics, and their distributions when nothing is missing, by parametric bootstrap.
//!
//! Replicates are simulated from the fitted model, its noise and the covariance of the emulator's error; the noise is
//! estimated from them again, the model is calibrated to them again (one step along its slopes), and the statistics are
//! computed as for the data.

use std::ops::Range;

use lacuna::math::random::{Stream, normal};
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;
use rayon::prelude::*;

use super::projection::Projection;
use super::scan::{Cell, Scan};
use super::score::{DesignMatrix, Scores, Spread, differences};
use crate::gap::experiment::Experiment;
use crate::gap::noise::{Noise, ResponseTangents};
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, precision};
use crate::gap::system::whitener::Whitener;

/// Simulations between two checks of the stopping rule.
const ROUND: usize = 50;

/// Number of simulations whose scores are computed by one product of matrices.
const CHUNK: usize = 5;

/// Number of regressors whose scores are computed with the noise of a simulation: those with the largest scores under
/// the noise of the data. The largest is practically always among them, because the two noises differ little.
const STRONGEST: usize = 40;

/// A statistic that this number of simulations reach has a p-value well above every level that is used.
const ENOUGH: usize = 10;

/// The test statistics of one set of data.
#[derive(Debug, Clone)]
pub struct TestStatistics {
    /// The studentised score of each regressor.
    pub scores: Scores,
    /// The best cell of each place that is scanned.
    pub cells: Vec<Cell>,
    /// The energy of the whole residual: the sum of the squares of `residual`, in units of the noise variance.
    pub energy: f64,
    /// The residual, one value an output: whitened (standard deviations of the mean), projected off the slopes of the
    /// calibrated unknowns.
    pub residual: Vec<f64>,
}

/// The statistics of simulated data without any missing effect, one entry a simulation.
#[derive(Debug, Clone, Default)]
pub struct NullDistribution {
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

/// The p-value of a statistic: the share of the `n` simulated values, with itself, that are as large; at least
/// `1 / (n + 1)`.
pub fn probability(null: &[f64], value: f64) -> f64 {
    let above = null.iter().filter(|x| **x >= value).count();
    (above + 1) as f64 / (null.len() + 1) as f64
}

/// Returns true if a p-value is the smallest that the simulations can give, `1 / (n + 1)`: an upper bound of the true
/// one. `n` is the largest number of simulations, or a multiple of fifty below it where they ended early.
pub fn is_at_floor(p: f64, simulations: usize) -> bool {
    if simulations == 0 {
        return false;
    }
    // No p-value lies between the floor and twice the floor.
    let rounds = (1.0 / p - 1.0) / ROUND as f64;
    let ended = rounds > 0.5 && (rounds - rounds.round()).abs() < 1e-6;
    ended || p * (simulations as f64 + 1.0) < 1.5
}

impl NullDistribution {
    /// The p-value of the largest score.
    pub fn of_score(&self, statistics: &TestStatistics, design: &DesignMatrix) -> f64 {
        probability(&self.score, statistics.scores.largest(design))
    }

    /// The p-value of the largest cell statistic.
    pub fn of_scan(&self, statistics: &TestStatistics) -> f64 {
        probability(&self.best_cells(), statistics.best_cell())
    }

    /// The p-value of the energy.
    pub fn of_energy(&self, statistics: &TestStatistics) -> f64 {
        probability(&self.energy, statistics.energy)
    }

    fn best_cells(&self) -> Vec<f64> {
        let best = |cells: &Vec<f64>| cells.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        self.cells.iter().map(best).collect()
    }

    /// Returns true if none of the decisions at a level can change: each statistic of the data is either reached too often
    /// to become significant, or by no simulation of so many that it is.
    fn settled(&self, data: &TestStatistics, design: &DesignMatrix, level: f64) -> bool {
        let is_settled = |null: &[f64], value: f64| {
            let reached = null.iter().filter(|x| **x >= value).count();
            reached >= ENOUGH || reached == 0 && 1.0 / (null.len() + 1) as f64 <= level
        };
        !self.energy.is_empty()
            && is_settled(&self.energy, data.energy)
            && is_settled(&self.score, data.scores.largest(design))
            && is_settled(&self.best_cells(), data.best_cell())
    }
}

impl TestStatistics {
    fn best_cell(&self) -> f64 {
        self.cells.iter().map(|cell| cell.statistic).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// A calibrated system with everything that its test statistics need.
pub struct TestSetting<'a> {
    /// The system.
    pub system: &'a System<'a>,
    /// The best fit.
    pub fit: &'a Fit,
    /// The noise of its replicates.
    pub noise: &'a Noise,
    /// The whitener of the mean under that noise.
    pub whitener: &'a Whitener,
    /// The projection off the slopes of the fit.
    pub projection: &'a Projection,
    /// The regressors of the candidates.
    pub design: &'a DesignMatrix,
    /// The cells of the scan.
    pub scan: &'a Scan,
}

impl TestSetting<'_> {
    fn experiment(&self) -> &Experiment<'_> {
        self.system.experiment
    }

    /// The statistics of the data.
    pub fn statistics(&self) -> TestStatistics {
        let left = self.projection.rest(&self.fit.residual);
        let (rows, spread) = differences(self.experiment());
        let white = self.whitener.whiten_rows(&rows);
        let scores = self.design.scores_of(&left, &white, &spread);
        let cells = self.scan.best(&left);
        let energy = left.iter().map(|z| z * z).sum();
        TestStatistics { scores, cells, energy, residual: left }
    }

    /// The null distribution from at most `count` simulations, and from fewer if the decisions about all three statistics
    /// of the data are made: each has been exceeded often enough (sequential Monte Carlo p-values: Besag and Clifford,
    /// Biometrika 78 (1991) 301), or never in so many that its p-value is below `level`. If nothing is missing, the
    /// probability that none of `n` simulations exceeds a statistic is `1 / (n + 1)`: the p-value stays valid.
    pub fn nulls(
        &self,
        data: &TestStatistics,
        count: usize,
        level: f64,
        stream: &Stream,
    ) -> NullDistribution {
        let mut nulls = NullDistribution::default();
        let around = self.system.around(&self.fit.at);
        while nulls.energy.len() < count && !nulls.settled(data, self.design, level) {
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

    /// A batch of simulations, whose scores are computed by one product of matrices.
    fn simulations(
        &self,
        numbers: Range<usize>,
        around: &ResponseTangents,
        stream: &Stream,
    ) -> Vec<Drawn> {
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
        let scores = self.design.scores(&left, &self.whitener.whiten_rows(&rows), &spread);
        let each = simulated.iter().zip(misfits.iter_rows()).zip(scores);
        each.map(|((one, misfit), scores)| self.drawn(one, misfit, &scores, around)).collect()
    }

    /// One simulation with its noise estimated again; `near` are its scores under the noise of the data.
    fn drawn(
        &self,
        simulated: &Experiment<'_>,
        misfit: &[f64],
        near: &Scores,
        around: &ResponseTangents,
    ) -> Drawn {
        let noise = Noise::of(simulated, around, Some(self.noise));
        let whitener = Whitener::new(simulated, &noise, &around.response);
        let slopes = whitener.whiten_rows(&self.fit.at.tangents);
        let precisions: Vec<f64> = self.system.priors().iter().map(precision).collect();
        let projection = Projection::off(&slopes, &precisions);
        let left = projection.rest(&whitener.whiten(misfit));
        // The noise of a record is estimated from its misfit and may differ much from that of the data.
        let strongest = if simulated.has_records() {
            self.design
                .strongest(near, usize::MAX, &whitener, &projection)
                .with_common(simulated, &whitener)
        } else {
            self.design.strongest(near, STRONGEST, &whitener, &projection)
        };
        let (rows, spread) = differences(simulated);
        let scores = strongest.scores_of(&left, &whitener.whiten_rows(&rows), &spread);
        Drawn {
            score: scores.largest(&strongest),
            cells: self.scan.best(&left).into_iter().map(|cell| cell.statistic).collect(),
            energy: dot(&left, &left),
        }
    }
}

/// A draw from the covariance of the emulator's error, one value an output, in the response's unit: the same error for
/// all replicates.
pub fn common_error(experiment: &Experiment<'_>, noise: &Noise, stream: &Stream) -> Vec<f64> {
    let mut all = noise.independent(experiment, &stream.named("remainder"));
    let mut rng = stream.generator();
    for error in &experiment.common {
        let draw: Vec<f64> = (0..error.factor.columns()).map(|_| normal(&mut rng)).collect();
        let drawn: Matrix = Matrix::from_vec(draw.len(), 1, draw);
        let moved = lacuna_linalg::multiply(&error.factor, &drawn);
        all.iter_mut().zip(moved.as_slice()).for_each(|(a, m)| *a += m);
    }
    all
}
