//! What errors of emulator and numerics do to the estimates, to first order.
//!
//! An error `e` of the response changes the score of the data; the estimates move by `V J' (g(r + e) - g(r))`, where
//! `V` is the posterior covariance, `J` the derivative of the response by the parameters and `g` that of the
//! log-likelihood by the response. For a likelihood that allows for the error the gradient is damped in its
//! directions.

use crate::assess::Finding;
use crate::assess::emulator::{self as check, Effect};
use crate::linalg::{Matrix, multiply_vector, transposed_multiply_vector};
use crate::math::moments::{self, Moments};
use crate::stage::Known;
use crate::stage::report::Artifacts;

use super::{Judged, some};

/// So many errors stand for all.
const MOST: usize = 100;

/// What was found, and how far the emulator's error moves the estimates.
#[derive(Default)]
pub(super) struct Errors {
    pub findings: Vec<Finding>,
    /// The largest shift over the parameters, in posterior standard deviations.
    pub shift: Option<f64>,
}

pub(super) fn of(judged: &Judged<'_>, all: &Artifacts<'_>) -> Errors {
    let known = judged.known;
    let section = judged.study.discrepancy.as_ref();
    let mut errors = Errors::default();
    if known.fitted.is_none() && known.numerics.is_none() {
        return errors;
    }
    let moves = Moves::of(judged);
    if let Some(fitted) = known.fitted {
        let allowed = section.is_some_and(|s| s.common.emulator_error);
        let near = fitted.value.errors_near_prior(judged.study);
        let size = root_mean_square(near.as_slice());
        let fresh = all.validated.and_then(|v| v.value.emulator_at_posterior);
        let ratio = fresh.map_or(1.0, |(error, _)| error / size);
        // What fresh runs at the posterior say outweighs errors elsewhere.
        let factor = if fresh.is_some() && !allowed && ratio.is_finite() { ratio } else { 1.0 };
        let effect = moves.effect(&near, factor, allowed);
        errors.shift = effect.largest().filter(|shift| shift.is_finite());
        errors.findings.extend(check::emulator(&effect));
        if let Some((_, count)) = fresh {
            let matters = errors.shift.is_none_or(|shift| shift * ratio.max(1.0) > 0.5);
            errors.findings.extend(check::at_posterior(ratio, count, matters));
        }
    }
    if let (Some(kept), Some(numerics)) = (known.numerics, &judged.study.numerical_error) {
        let effect = moves.effect(&kept.value.differences, numerics.written.whole(), true);
        errors.findings.extend(check::numerical(&effect));
    }
    errors
}

/// What is to be said of an emulator whatever was measured.
pub(super) fn of_emulator(known: &Known<'_>) -> Vec<Finding> {
    let fitted = known.fitted.map(|kept| &kept.value.errors);
    let left_out = fitted.and_then(|errors| check::left_out(errors.loo, errors.training));
    let unfinished = known
        .refinement
        .filter(|r| !r.reached)
        .map(|r| check::unfinished(r.rounds, r.ratio, r.until, r.clear));
    some([left_out, unfinished])
}

fn root_mean_square(values: &[f64]) -> f64 {
    let squares: Vec<f64> = values.iter().map(|v| v * v).collect();
    moments::mean(&squares).sqrt()
}

/// From errors of the response to shifts of the estimates.
struct Moves<'a> {
    judged: &'a Judged<'a>,
    /// The derivatives of the response by parameters and effects' parameters.
    jacobian: Matrix,
    /// Their posterior covariance.
    covariance: Matrix,
    /// The derivative of the log-likelihood by the response at the MAP.
    gradient: Vec<f64>,
}

impl<'a> Moves<'a> {
    fn of(judged: &'a Judged<'a>) -> Self {
        let outcome = &judged.calibrated.outcome;
        let draws = judged.calibrated.draws.from_step(outcome.burn_in);
        let map = &outcome.map;
        let moved = map.len() - judged.likelihood.hyperparameters().len();
        let points = draws.points();
        let whole = Moments::of_rows(&points).covariance();
        let own: Vec<usize> = (0..moved).collect();
        let covariance = whole.select_rows(&own).select_columns(&own);
        let mut around = Vec::new();
        let mut widths = Vec::new();
        for j in 0..moved {
            let column = points.column(j);
            let least = column.iter().copied().fold(f64::INFINITY, f64::min);
            let most = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            // Steps stay among the draws, where the forward map is at home.
            let step = 0.25 * covariance[(j, j)].sqrt();
            let ends = [(map[j] - step).max(least), (map[j] + step).min(most)];
            widths.push(ends[1] - ends[0]);
            for end in ends {
                let mut point = map.clone();
                point[j] = end;
                around.push(point);
            }
        }
        let responses = judged.responses(&Matrix::from_rows(map.len(), around));
        let slope = |i: usize, j: usize| {
            let change = responses[2 * j + 1][i] - responses[2 * j][i];
            if widths[j] > 0.0 { change / widths[j] } else { 0.0 }
        };
        let jacobian = Matrix::from_fn(judged.response.len(), moved, slope);
        let gradient = judged.likelihood.gradient(&judged.response, judged.hyper(map)).0;
        Self { judged, jacobian, covariance, gradient }
    }

    /// What errors, one a row and times a factor, do to the estimates of the study's parameters.
    fn effect(&self, errors: &Matrix, factor: f64, allowed: bool) -> Effect {
        let judged = self.judged;
        let hyper = judged.hyper(&judged.calibrated.outcome.map);
        let step = errors.rows().div_ceil(MOST).max(1);
        let rows: Vec<usize> = (0..errors.rows()).step_by(step).collect();
        let parameters = &judged.study.parameters;
        let mut squares = vec![0.0; parameters.len()];
        for &row in &rows {
            let wrong: Vec<f64> =
                judged.response.iter().zip(errors.row(row)).map(|(r, e)| r + factor * e).collect();
            let gradient = judged.likelihood.gradient(&wrong, hyper).0;
            let change: Vec<f64> =
                gradient.iter().zip(&self.gradient).map(|(a, b)| a - b).collect();
            let score = transposed_multiply_vector(&self.jacobian, &change);
            let shift = multiply_vector(&self.covariance, &score);
            for (sum, (j, shift)) in squares.iter_mut().zip(shift.iter().enumerate()) {
                *sum += shift * shift / self.covariance[(j, j)];
            }
        }
        let count = rows.len().max(1) as f64;
        let named = parameters.iter().zip(&squares);
        let shifts = named.map(|(p, s)| (p.name.clone(), (s / count).sqrt()));
        Effect {
            shifts: shifts.filter(|(_, shift)| shift.is_finite()).collect(),
            against_noise: self.against_noise(errors, factor),
            allowed,
        }
    }

    fn against_noise(&self, errors: &Matrix, factor: f64) -> Option<f64> {
        let summaries = self.judged.measured.used.summaries();
        let ratio = |(j, s): (usize, &crate::data::measurements::Summary)| {
            let error = s.sd()? / (s.count as f64).sqrt();
            (error > 0.0).then(|| factor * root_mean_square(&errors.column(j)) / error)
        };
        let ratios: Vec<f64> = summaries.iter().enumerate().filter_map(ratio).collect();
        (!ratios.is_empty()).then(|| moments::quantile(&moments::sorted(&ratios), 0.5))
    }
}
