//! Efficient scores of candidates, studentised by the replicates.
//!
//! The score of a candidate is the product of its derivative and of the residual, both projected off the span of the
//! calibrated unknowns (Rao's score test with nuisance parameters; Cox and Hinkley, Theoretical Statistics, section
//! 9.3). Its variance is that between the replicates' own scores, moderated by the noise model (Smyth, Statistical
//! Applications in Genetics and Molecular Biology 3 (2004) 3), so that a wrong noise model does not cause false alarms;
//! the variance by the emulator's error is added.

use lacuna::plugin::effect::{On, Placed, Situation};
use lacuna_linalg::vector::{dot, norm};
use lacuna_linalg::{Matrix, multiply_transposed};
use rayon::prelude::*;

use super::projection::Projection;
use crate::gap::candidates::{Candidate, Placement};
use crate::gap::experiment::Experiment;
use crate::gap::system::System;
use crate::gap::system::fit::Fit;
use crate::gap::system::switched;
use crate::gap::system::whitener::Whitener;

/// The prior weight of the noise model in the variance of a score, as a number of replicates.
const MODERATION: f64 = 4.0;

/// Regressors of one placement with a larger correlation than this count as one.
const SAME: f64 = 0.95;

/// A regressor is absorbed by the calibration if its projection has less than this share of its squared length.
const ABSORBED: f64 = 1e-6;

/// One column of the design matrix: the derivative of the response by the size of an effect, at one setting of its
/// other unknowns.
#[derive(Debug, Clone)]
pub struct Regressor {
    /// The index of the placement.
    pub placement: usize,
    /// The values of the effect's unknowns, in their units, from which a fit along this regressor starts.
    pub start: Vec<f64>,
    /// The sign that the prior allows for the size; zero for both.
    pub sign: f64,
    /// The share of its squared length that the calibrated unknowns absorb, from 0 to 1.
    pub absorbed: f64,
    /// The whitened length of its projection per unit of size: the inverse of the standard error of the size.
    pub length: f64,
}

/// The regressors of all placements, whitened and projected.
#[derive(Debug, Clone)]
pub struct DesignMatrix {
    /// The regressors, in the order of the rows of `rows`.
    pub regressors: Vec<Regressor>,
    /// The whitened, projected and normalised regressors, `regressors x outputs`.
    pub rows: Matrix,
    /// The variance of each score due to the covariance of the emulator's error.
    pub common: Vec<f64>,
    /// The derivatives of the response, `regressors x outputs`, in the response's unit per unit of size.
    changes: Matrix,
}

/// A regressor with its row of the design matrix and its derivative of the response.
struct Kept {
    regressor: Regressor,
    left: Vec<f64>,
    change: Vec<f64>,
}

/// Studentised scores.
#[derive(Debug, Clone)]
pub struct Scores {
    /// The score of each regressor over its standard error, with its sign; in order of the regressors.
    pub values: Vec<f64>,
}

impl Scores {
    /// The largest score with a sign that the prior allows; zero where there is none.
    pub fn largest(&self, design: &DesignMatrix) -> f64 {
        let each = self.values.iter().zip(&design.regressors);
        each.map(|(value, regressor)| regressor.strength(*value)).fold(0.0, f64::max)
    }
}

impl Regressor {
    /// The absolute value of a score, or zero where the prior does not allow its sign.
    pub fn strength(&self, score: f64) -> f64 {
        if self.sign == 0.0 { score.abs() } else { (score * self.sign).max(0.0) }
    }
}

impl DesignMatrix {
    /// The design matrix of placements at a fit. The response of `situation` is that of the fit.
    pub fn of(
        system: &System<'_>,
        fit: &Fit,
        candidates: &[Candidate],
        placements: &[Placement],
        situation: &Situation<'_>,
        whitener: &Whitener,
        projection: &Projection,
    ) -> Self {
        let experiment = system.experiment;
        let mut all = Vec::new();
        let mut rows = Matrix::zeros(0, experiment.outputs());
        let mut changes = rows.clone();
        let of = |(c, candidate): (usize, &Candidate)| -> Vec<Kept> {
            let slopes = slopes(system, fit, candidate, situation);
            let own = (0..placements.len()).filter(|&s| placements[s].candidate == c);
            let each = own.flat_map(|s| {
                let placed = placements[s].placed(experiment, candidates, "");
                Self::one(s, &placed, &slopes, whitener, projection)
            });
            each.collect()
        };
        let kept: Vec<Vec<Kept>> = candidates.par_iter().enumerate().map(of).collect();
        for one in kept.into_iter().flatten() {
            all.push(one.regressor);
            rows.push_row(&one.left);
            changes.push_row(&one.change);
        }
        let common = common(experiment, whitener, &rows);
        Self { regressors: all, rows, common, changes }
    }

    /// The derivative of the response by the size of a regressor, one value an output, in the response's unit.
    pub fn change(&self, regressor: usize) -> &[f64] {
        self.changes.row(regressor)
    }

    /// The `count` regressors of largest score at most, whitened with another noise. The share of the emulator's error in
    /// their variance is that under the noise of this matrix.
    pub fn strongest(
        &self,
        scores: &Scores,
        count: usize,
        whitener: &Whitener,
        projection: &Projection,
    ) -> Self {
        let strength = |j: &usize| self.regressors[*j].strength(scores.values[*j]);
        let mut chosen: Vec<usize> = (0..self.regressors.len()).collect();
        chosen.sort_by(|a, b| strength(b).total_cmp(&strength(a)).then(a.cmp(b)));
        chosen.truncate(count);
        let changes = self.changes.select_rows(&chosen);
        let (mut left, squares) = projection.rest_of_rows(whitener.whiten_rows(&changes));
        for (j, square) in squares.iter().enumerate() {
            let length = square.max(f64::MIN_POSITIVE).sqrt();
            left.row_mut(j).iter_mut().for_each(|x| *x /= length);
        }
        let common = chosen.iter().map(|&j| self.common[j]).collect();
        let all = chosen.iter().map(|&j| self.regressors[j].clone()).collect();
        Self { regressors: all, rows: left, common, changes }
    }

    /// The matrix with the share of the emulator's error under the noise of a whitener.
    pub fn with_common(mut self, experiment: &Experiment<'_>, whitener: &Whitener) -> Self {
        self.common = common(experiment, whitener, &self.rows);
        self
    }

    /// The different regressors of one placement.
    fn one(
        placement: usize,
        placed: &Placed<'_>,
        slopes: &[(Vec<f64>, Vec<f64>)],
        whitener: &Whitener,
        projection: &Projection,
    ) -> Vec<Kept> {
        let masked = slopes.iter().map(|(_, slope)| -> Vec<f64> {
            slope.iter().zip(&placed.acts).map(|(x, acts)| if *acts { *x } else { 0.0 }).collect()
        });
        let changes = Matrix::from_rows(placed.acts.len(), masked);
        let white = whitener.whiten_rows(&changes);
        let lengths: Vec<f64> = white.iter_rows().map(|row| dot(row, row)).collect();
        let (left, squares) = projection.rest_of_rows(white);
        let sign = sign(placed);
        let mut kept: Vec<Kept> = Vec::new();
        for (i, (start, _)) in slopes.iter().enumerate() {
            let seen = squares[i] > ABSORBED * lengths[i] && lengths[i] > 0.0;
            if !seen {
                continue;
            }
            let length = squares[i].sqrt();
            let row: Vec<f64> = left.row(i).iter().map(|x| x / length).collect();
            if kept.iter().any(|other| dot(&other.left, &row).abs() > SAME) {
                continue;
            }
            let absorbed = 1.0 - squares[i] / lengths[i];
            let regressor = Regressor { placement, start: start.clone(), sign, absorbed, length };
            kept.push(Kept { regressor, left: row, change: changes.row(i).to_vec() });
        }
        kept
    }

    /// The scores of a whitened residual, one value an output. `differences`, `replicates x outputs`, are the whitened
    /// contributions of the replicates less their mean, from which the variance of the scores is estimated.
    pub fn scores_of(&self, residual: &[f64], differences: &Matrix, spread: &Spread) -> Scores {
        let residual = Matrix::from_rows(residual.len(), [residual]);
        self.scores(&residual, differences, spread).remove(0)
    }

    /// The scores of several residuals, `residuals x outputs`; `differences` has equally many rows for each.
    pub fn scores(&self, residuals: &Matrix, differences: &Matrix, spread: &Spread) -> Vec<Scores> {
        let means = multiply_transposed(residuals, &self.rows);
        let parts = multiply_transposed(differences, &self.rows);
        let each = spread.weights.len();
        let own = |(b, means): (usize, &[f64])| {
            let mut squares = vec![0.0; means.len()];
            for (k, w) in spread.weights.iter().enumerate() {
                let row = parts.row(b * each + k);
                squares.iter_mut().zip(row).for_each(|(sum, part)| *sum += w * part * part);
            }
            let freedom = spread.freedom;
            let student = |((mean, own), common): ((&f64, &f64), &f64)| {
                let model = (1.0 - common).max(0.0);
                let moderated = (MODERATION * model + freedom * own) / (MODERATION + freedom);
                mean / (moderated + common).sqrt().max(f64::MIN_POSITIVE)
            };
            Scores { values: means.iter().zip(&squares).zip(&self.common).map(student).collect() }
        };
        means.iter_rows().enumerate().map(own).collect()
    }
}

/// Contribution of the differences between replicates to the variance of a mean.
#[derive(Debug, Clone, Default)]
pub struct Spread {
    /// The weight of the square of each row in the variance.
    pub weights: Vec<f64>,
    /// The degrees of freedom of that variance.
    pub freedom: f64,
}

/// The contributions of the replicates to the mean less their average, `replicates x outputs`, in the response's unit,
/// with their weights in a variance.
pub fn differences(experiment: &Experiment<'_>) -> (Matrix, Spread) {
    let (counts, means) = experiment.means();
    let mut rows = Matrix::zeros(0, experiment.outputs());
    let mut weights = Vec::new();
    let mut freedom = 0.0;
    for condition in &experiment.conditions {
        let count = condition.replicates.len() as f64;
        if count < 2.0 {
            continue;
        }
        freedom += count - 1.0;
        for replicate in &condition.replicates {
            let mut row = vec![0.0; experiment.outputs()];
            for (i, y) in condition.outputs.clone().zip(replicate) {
                row[i] = y.map_or(0.0, |y| (y - means[i]) / counts[i]);
            }
            rows.push_row(&row);
            weights.push(count / (count - 1.0));
        }
    }
    (rows, Spread { weights, freedom })
}

/// A slope smaller than this share of the change over its start counts as zero: the effect is of second order there.
const FLAT: f64 = 1e-6;

/// The derivatives of the response by the size of a candidate that acts everywhere, each with a start: for each setting
/// of its other unknowns the derivative at absence, or where that vanishes the difference quotient over each start.
pub fn slopes(
    system: &System<'_>,
    fit: &Fit,
    candidate: &Candidate,
    situation: &Situation<'_>,
) -> Vec<(Vec<f64>, Vec<f64>)> {
    let layouts = system.experiment.layouts;
    let layout = &layouts.blocks[0];
    let placed = Placed::new("", &*candidate.effect, layouts, &On::new());
    if !candidate.effect.switches().is_empty() {
        return switched::slopes(system, fit, &placed, situation);
    }
    let absent = placed.absent();
    let point = system.parameters(&fit.at.point);
    let mut by_indices: Vec<(Vec<f64>, bool)> = Vec::new();
    let mut slopes = Vec::new();
    for start in candidate.effect.starts(layout, situation) {
        let known = by_indices.iter().find(|(indices, _)| indices[..] == start[1..]);
        if known.is_some_and(|(_, sloping)| *sloping) {
            continue;
        }
        let change = placed.apply(situation.response, &start, point);
        let over = |(with, without): (&f64, &f64)| (with - without) / (start[0] - absent[0]);
        let mut slope: Vec<f64> = change.iter().zip(situation.response).map(over).collect();
        if known.is_none() {
            let values = [&absent[..1], &start[1..]].concat();
            let tangent = placed.by_parameters(situation.response, &values, point).column(0);
            let sloping = norm(&tangent) > FLAT * norm(&slope);
            by_indices.push((start[1..].to_vec(), sloping));
            if sloping {
                slope = tangent;
            }
        }
        if slope.iter().all(|x| x.is_finite()) {
            slopes.push((start, slope));
        }
    }
    slopes
}

/// The sign that a size must have: that of its prior's support around absence.
fn sign(placed: &Placed<'_>) -> f64 {
    let absent = placed.absent()[0];
    let (low, high) = placed.hyperparameters()[0].prior.support();
    if low >= absent {
        1.0
    } else if high <= absent {
        -1.0
    } else {
        0.0
    }
}

/// The variance of the product of the emulator's error with each row.
fn common(experiment: &Experiment<'_>, whitener: &Whitener, rows: &Matrix) -> Vec<f64> {
    let mut variance = vec![0.0; rows.rows()];
    for error in &experiment.common {
        let white = whitener.whiten_rows(&error.factor.transposed());
        let products = multiply_transposed(rows, &white);
        for (v, row) in variance.iter_mut().zip(products.iter_rows()) {
            *v += row.iter().map(|x| x * x).sum::<f64>();
        }
    }
    variance.iter_mut().zip(whitener.of_independent(rows)).for_each(|(v, own)| *v += own);
    variance.iter().map(|v| v.min(1.0)).collect()
}
