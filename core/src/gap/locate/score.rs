//! Efficient scores of candidates, studentised by the replicates.
//!
//! The score of a candidate is the product of what it would do and of what is left of the residual, both off the span
//! of the calibrated unknowns (Rao's score test with nuisance parameters; Cox and Hinkley, Theoretical
//! Statistics, section 9.3). Its scatter is that between the replicates' own scores, moderated by the noise model
//! (Smyth, Statistical Applications in Genetics and Molecular Biology 3 (2004) 3), so that a wrong noise model
//! does not make false alarms; errors that all replicates share come on top.

use super::projection::Projection;
use crate::gap::candidates::{Candidate, Suspect};
use crate::gap::experiment::Experiment;
use crate::gap::fit::Fit;
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::gap::wide;
use crate::linalg::vector::{dot, norm};
use crate::linalg::{Matrix, multiply_transposed};
use crate::plugin::effect::{On, Placed, Situation};

/// The weight of the noise model in the scatter of a score, as a number of replicates.
const MODERATION: f64 = 4.0;

/// Directions nearer to each other than this correlation are one.
const SAME: f64 = 0.95;

/// A direction that keeps less of its length than this, squared, is absorbed by the calibration.
const ABSORBED: f64 = 1e-6;

/// One way in which a suspect can show.
#[derive(Debug, Clone)]
pub struct Direction {
    /// The suspect's place in the list.
    pub suspect: usize,
    /// Values of its parameters from which a fit along this direction starts.
    pub start: Vec<f64>,
    /// The sign that its size must have, zero for both.
    pub sign: f64,
    /// The share of it that the calibrated unknowns absorb.
    pub absorbed: f64,
    /// The length of what is left, per unit of size: whitened.
    pub length: f64,
}

/// The directions of all suspects, whitened and projected.
#[derive(Debug, Clone)]
pub struct Directions {
    /// What they are.
    pub all: Vec<Direction>,
    /// What is left of each, of length one, one a row.
    pub left: Matrix,
    /// The variance of each score due to errors that all replicates share.
    pub common: Vec<f64>,
    /// What each does to the response, one a row.
    changes: Matrix,
}

/// A direction that was kept: what is left of it whitened, of length one, and what it does to the response.
struct Kept {
    direction: Direction,
    left: Vec<f64>,
    change: Vec<f64>,
}

/// Studentised scores.
#[derive(Debug, Clone)]
pub struct Scores {
    /// The score of each direction over its standard error, with a sign.
    pub values: Vec<f64>,
}

impl Scores {
    /// The largest score that counts, by the signs that sizes may have.
    pub fn largest(&self, directions: &Directions) -> f64 {
        let each = self.values.iter().zip(&directions.all);
        each.map(|(value, direction)| direction.strength(*value)).fold(0.0, f64::max)
    }
}

impl Direction {
    /// A score as far as the sign that its size may have allows.
    pub fn strength(&self, score: f64) -> f64 {
        if self.sign == 0.0 { score.abs() } else { (score * self.sign).max(0.0) }
    }
}

impl Directions {
    /// The directions of suspects at a fit, whose response is that of the situation.
    pub fn of(
        system: &System<'_>,
        fit: &Fit,
        candidates: &[Candidate],
        suspects: &[Suspect],
        situation: &Situation<'_>,
        whitener: &Whitener,
        projection: &Projection,
    ) -> Self {
        let experiment = system.experiment;
        let mut all = Vec::new();
        let mut rows = Matrix::zeros(0, experiment.outputs());
        let mut changes = rows.clone();
        for (c, candidate) in candidates.iter().enumerate() {
            let own: Vec<usize> =
                (0..suspects.len()).filter(|&s| suspects[s].candidate == c).collect();
            let slopes = slopes(system, fit, candidate, situation);
            for s in own {
                let placed = suspects[s].placed(experiment, candidates, "");
                let kept = Self::one(s, &placed, &slopes, whitener, projection);
                for one in kept {
                    all.push(one.direction);
                    rows.push_row(&one.left);
                    changes.push_row(&one.change);
                }
            }
        }
        let common = common(experiment, whitener, &rows);
        Self { all, left: rows, common, changes }
    }

    /// Those that score most, so many at most, seen through another noise.
    pub fn strongest(
        &self,
        scores: &Scores,
        count: usize,
        experiment: &Experiment<'_>,
        whitener: &Whitener,
        projection: &Projection,
    ) -> Self {
        let strength = |j: &usize| self.all[*j].strength(scores.values[*j]);
        let mut chosen: Vec<usize> = (0..self.all.len()).collect();
        chosen.sort_by(|a, b| strength(b).total_cmp(&strength(a)).then(a.cmp(b)));
        chosen.truncate(count);
        let changes = self.changes.select_rows(&chosen);
        let (mut left, squares) = projection.rest_of_rows(whitener.whiten_rows(&changes));
        for (j, square) in squares.iter().enumerate() {
            let length = square.max(f64::MIN_POSITIVE).sqrt();
            left.row_mut(j).iter_mut().for_each(|x| *x /= length);
        }
        let common = common(experiment, whitener, &left);
        let all = chosen.iter().map(|&j| self.all[j].clone()).collect();
        Self { all, left, common, changes }
    }

    /// The different directions of one suspect.
    fn one(
        suspect: usize,
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
            let direction = Direction { suspect, start: start.clone(), sign, absorbed, length };
            kept.push(Kept { direction, left: row, change: changes.row(i).to_vec() });
        }
        kept
    }

    /// The scores of a residual whose replicates differ from the mean by these whitened parts, one a row; `spread` is the
    /// freedom of the differences.
    pub fn scores_of(&self, residual: &[f64], differences: &Matrix, spread: &Spread) -> Scores {
        let residual = Matrix::from_rows(residual.len(), [residual]);
        self.scores(&residual, differences, spread).remove(0)
    }

    /// The same of several residuals, one a row, with as many differences each.
    pub fn scores(&self, residuals: &Matrix, differences: &Matrix, spread: &Spread) -> Vec<Scores> {
        let means = multiply_transposed(residuals, &self.left);
        let parts = multiply_transposed(differences, &self.left);
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

/// How the differences of replicates add to the variance of a mean.
#[derive(Debug, Clone, Default)]
pub struct Spread {
    /// The weight of each difference squared.
    pub weights: Vec<f64>,
    /// The number of independent differences.
    pub freedom: f64,
}

/// The parts of the mean's residual that the replicates make, less their mean, one a row; `sum` of all is zero.
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

/// A slope that is this much smaller than the change over its start is none: the effect is of second order.
const FLAT: f64 = 1e-6;

/// What a candidate that acts everywhere does per unit of its size, with a start: for each setting of its indices the
/// slope at absence, or where that vanishes the change over each start.
fn slopes(
    system: &System<'_>,
    fit: &Fit,
    candidate: &Candidate,
    situation: &Situation<'_>,
) -> Vec<(Vec<f64>, Vec<f64>)> {
    let layouts = system.experiment.layouts;
    let layout = &layouts.blocks[0];
    let placed = Placed::new("", &*candidate.effect, layouts, &On::new());
    if !candidate.effect.switches().is_empty() {
        return wide::slopes(system, fit, &placed, situation);
    }
    let absent = placed.absent();
    let mut by_indices: Vec<(Vec<f64>, bool)> = Vec::new();
    let mut slopes = Vec::new();
    for start in candidate.effect.starts(layout, situation) {
        let known = by_indices.iter().find(|(indices, _)| indices[..] == start[1..]);
        if known.is_some_and(|(_, sloping)| *sloping) {
            continue;
        }
        let change = placed.apply(situation.response, &start);
        let over = |(with, without): (&f64, &f64)| (with - without) / (start[0] - absent[0]);
        let mut slope: Vec<f64> = change.iter().zip(situation.response).map(over).collect();
        if known.is_none() {
            let values = [&absent[..1], &start[1..]].concat();
            let tangent = placed.by_parameters(situation.response, &values).column(0);
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

/// The variance that errors of the forward map give to a product with each row.
fn common(experiment: &Experiment<'_>, whitener: &Whitener, rows: &Matrix) -> Vec<f64> {
    let mut variance = vec![0.0; rows.rows()];
    for error in &experiment.common {
        let white = whitener.whiten_rows(&error.factor.transposed());
        let products = multiply_transposed(rows, &white);
        for (v, row) in variance.iter_mut().zip(products.iter_rows()) {
            *v += row.iter().map(|x| x * x).sum::<f64>();
        }
    }
    variance.iter_mut().zip(whitener.of_remainder(rows)).for_each(|(v, own)| *v += own);
    variance.iter().map(|v| v.min(1.0)).collect()
}
