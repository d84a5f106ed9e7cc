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
    /// The number of simulations after which they end if none of them reaches the data; zero if they do not.
    pub early: usize,
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

/// The p-value of a statistic whose simulations end after `early` of them if none reaches it. These outcomes are the
/// most extreme, whether or not the simulations did end; the others are ordered by the number of simulations that reach
/// the statistic. If nothing is missing all ranks of the data are equally probable, which gives each outcome its
/// probability; the p-value is that of all outcomes as extreme.
fn probability_with_look(null: &[f64], value: f64, early: usize) -> f64 {
    let n = null.len();
    if early == 0 || n < early {
        return probability(null, value);
    }
    let mut p = 1.0 / (early + 1) as f64;
    if null[..early].iter().all(|x| *x < value) {
        return p;
    }
    let reached = null.iter().filter(|x| **x >= value).count();
    // The probability that none of so many exceedances is among the first simulations.
    let mut later = 1.0;
    for j in 0..reached {
        later *= (n - j).saturating_sub(early) as f64 / (n - j) as f64;
        p += (1.0 - later) / (n + 1) as f64;
    }
    p
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
        self.probability(&self.score, statistics.scores.largest(design))
    }

    /// The p-value of the largest cell statistic.
    pub fn of_scan(&self, statistics: &TestStatistics) -> f64 {
        self.probability(&self.best_cells(), statistics.best_cell())
    }

    /// The p-value of the energy.
    pub fn of_energy(&self, statistics: &TestStatistics) -> f64 {
        self.probability(&self.energy, statistics.energy)
    }

    /// The p-value of a statistic from its values in all simulations.
    pub fn probability(&self, null: &[f64], value: f64) -> f64 {
        probability_with_look(null, value, self.early)
    }

    fn best_cells(&self) -> Vec<f64> {
        let best = |cells: &Vec<f64>| cells.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        self.cells.iter().map(best).collect()
    }

    /// Returns true if no decision can change.
    fn settled(&self, data: &TestStatistics, design: &DesignMatrix) -> bool {
        let early = self.early;
        is_decided(&self.energy, data.energy, early)
            && is_decided(&self.score, data.scores.largest(design), early)
            && is_decided(&self.best_cells(), data.best_cell(), early)
    }
}

/// Returns true if a statistic is either reached too often to become significant, or by none of the first simulations.
fn is_decided(null: &[f64], value: f64, early: usize) -> bool {
    let reached = |null: &[f64]| null.iter().filter(|x| **x >= value).count();
    let many = null.len() >= early && early > 0;
    reached(null) >= ENOUGH || many && reached(&null[..early]) == 0
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
    /// Biometrika 78 (1991) 301), or never in so many that its p-value is below `level`. The p-values allow for this look
    /// at the first simulations.
    pub fn nulls(
        &self,
        data: &TestStatistics,
        count: usize,
        level: f64,
        stream: &Stream,
    ) -> NullDistribution {
        let rounds = (1.0 / level - 1.0) / ROUND as f64;
        let early = ROUND * (rounds - 1e-9).ceil() as usize;
        let mut nulls = NullDistribution { early, ..NullDistribution::default() };
        let around = self.system.around(&self.fit.at);
        while nulls.energy.len() < count && !nulls.settled(data, self.design) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::uniform;

    /// If data and simulations have one law, p-values are valid whatever the level: `P(p <= x) <= x`, although the number
    /// of simulations depends on the data. The share of `n` cases has the standard error `sqrt(x (1 - x) / n)`.
    #[test]
    fn simulations_that_end_early_keep_p_values_valid() {
        let (cases, most, early) = (20_000, 400, 100);
        let mut rng = Stream::root(4).generator();
        let (mut ended, mut p): (usize, Vec<f64>) = (0, Vec::new());
        for _ in 0..cases {
            let value = uniform(&mut rng);
            let mut null: Vec<f64> = Vec::new();
            while null.len() < most && !is_decided(&null, value, early) {
                null.extend((0..ROUND).map(|_| uniform(&mut rng)));
            }
            ended += usize::from(null.len() < most);
            p.push(probability_with_look(&null, value, early));
        }
        assert!(ended > cases * 9 / 10, "{ended}");
        for x in [0.01, 0.03, 0.1] {
            let share = p.iter().filter(|p| **p <= x).count() as f64 / cases as f64;
            let error = (x * (1.0 - x) / cases as f64).sqrt();
            assert!(share < x + 4.0 * error, "{x}: {share}");
            assert!(share > 0.7 * x, "{x}: {share}");
        }
    }

    #[test]
    fn the_smallest_p_value_is_an_upper_bound() {
        for (p, simulations) in [(1.0 / 101.0, 199), (1.0 / 200.0, 199), (1.0 / 400.0, 399)] {
            assert!(is_at_floor(p, simulations));
        }
        for (p, simulations) in
            [(2.0 / 200.0, 199), (3.0 / 400.0, 399), (0.5, 199), (1.0, 199), (0.01, 0)]
        {
            assert!(!is_at_floor(p, simulations), "{p}");
        }
    }
}
