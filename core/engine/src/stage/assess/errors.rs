//! Shifts of the estimates caused by errors of emulator and numerics, to first order.
//!
//! An error `e` of the response changes the score of the data; the estimates move by `V J' (g(r + e) - g(r))`, where
//! `V` is the posterior covariance, `J` the derivative of the response by the parameters and `g` that of the
//! log-likelihood by the response. For a likelihood that includes the error in its covariance the gradient is damped in
//! the directions of the error; one that samples the weights of these directions is damped as if the weights were
//! integrated out.

use lacuna::math::moments::{self, Moments};
use lacuna::plugin::discrepancy::SampledErrors;
use lacuna_linalg::{
    Cholesky, Matrix, multiply, multiply_vector, transposed_multiply, transposed_multiply_vector,
};

use super::{Judged, some};
use crate::assess::Finding;
use crate::assess::emulator::{self as check, Effect};
use crate::stage::artifacts::Artifacts;
use crate::stage::inverse_problem::InverseProblem;

/// Largest number of error curves that are evaluated.
const MOST: usize = 100;

/// Findings, and the shift of the estimates by the emulator's error.
#[derive(Default)]
pub(super) struct Errors {
    pub findings: Vec<Finding>,
    /// Largest shift over the parameters, in posterior standard deviations.
    pub shift: Option<f64>,
}

pub(super) fn of(judged: &Judged<'_>, all: &Artifacts<'_>) -> Errors {
    let problem = judged.problem;
    let section = judged.study.discrepancy.as_ref();
    let mut errors = Errors::default();
    if problem.fitted().is_none() && problem.numerics().is_none() {
        return errors;
    }
    let moves = Moves::of(judged);
    if let Some(fitted) = problem.fitted() {
        let allowed = section.is_some_and(|s| s.common.emulator_error);
        let near = fitted.value.errors_near_prior(judged.study);
        let size = root_mean_square(near.as_slice());
        let fresh = all.validated.and_then(|v| v.value.emulator_at_posterior);
        let ratio = fresh.map_or(1.0, |(error, _)| error / size);
        // Fresh runs at the posterior take precedence over errors elsewhere.
        let factor = if fresh.is_some() && !allowed && ratio.is_finite() { ratio } else { 1.0 };
        let effect = moves.effect(&near, factor, allowed);
        errors.shift = effect.largest().filter(|shift| shift.is_finite());
        errors.findings.extend(check::emulator(&effect));
        if let Some((_, count)) = fresh {
            let matters = errors.shift.is_none_or(|shift| shift * ratio.max(1.0) > 0.5);
            errors.findings.extend(check::at_posterior(ratio, count, matters));
        }
    }
    if let (Some(kept), Some(numerics)) = (problem.numerics(), &judged.study.numerical_error) {
        let effect = moves.effect(&kept.value.differences, numerics.written.whole(), true);
        errors.findings.extend(check::numerical(&effect));
    }
    errors.findings.extend(moves.sampled.as_ref().and_then(|sampled| moves.left_out(sampled)));
    errors
}

/// Findings about an emulator that do not depend on the measurements.
pub(super) fn of_emulator(problem: &InverseProblem<'_>) -> Vec<Finding> {
    let fitted = problem.fitted().map(|kept| &kept.value.errors);
    let left_out = fitted.and_then(|errors| check::left_out(errors.loo, errors.training));
    let unfinished = problem
        .refinement()
        .filter(|r| !r.reached)
        .map(|r| check::unfinished(r.rounds, (r.ratio, r.of), r.until, r.clear));
    some([left_out, unfinished])
}

fn root_mean_square(values: &[f64]) -> f64 {
    let squares: Vec<f64> = values.iter().map(|v| v * v).collect();
    moments::mean(&squares).sqrt()
}

/// Maps errors of the response to shifts of the estimates.
struct Moves<'a> {
    judged: &'a Judged<'a>,
    /// Derivatives of the response by parameters and effects' parameters, `outputs x unknowns`.
    jacobian: Matrix,
    /// Posterior covariance of these unknowns.
    covariance: Matrix,
    /// Derivative of the log-likelihood by the response at the MAP.
    gradient: Vec<f64>,
    /// Set if the discrepancy samples the errors: at fixed weights the gradient is not damped in their directions.
    sampled: Option<Sampled>,
}

/// Generalised least squares with the directions that a discrepancy samples.
struct Sampled {
    /// `(S + K K')^-1 J` with the noise `S` of the mean curve and the sampled factor `K`.
    weights: Matrix,
    left_out: Matrix,
    directions: usize,
}

impl Sampled {
    fn of(errors: SampledErrors, jacobian: &Matrix) -> Option<Self> {
        let scaled = |matrix: &Matrix| {
            Matrix::from_fn(matrix.rows(), matrix.columns(), |i, j| {
                matrix[(i, j)] / errors.noise[i].sqrt()
            })
        };
        let (slopes, sampled) = (scaled(jacobian), scaled(&errors.sampled));
        // Woodbury: (1 + K K')^-1 = 1 - K (1 + K'K)^-1 K'.
        let mut inner = transposed_multiply(&sampled, &sampled);
        (0..inner.rows()).for_each(|k| inner[(k, k)] += 1.0);
        let along =
            Cholesky::new(&inner).ok()?.solve_matrix(&transposed_multiply(&sampled, &slopes));
        let damped = multiply(&sampled, &along);
        let weights = Matrix::from_fn(slopes.rows(), slopes.columns(), |i, j| {
            (slopes[(i, j)] - damped[(i, j)]) / errors.noise[i].sqrt()
        });
        Some(Self { weights, left_out: errors.left_out, directions: errors.sampled.columns() })
    }
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
            // Steps stay within the range of the draws, where the forward map is valid.
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
        let errors = judged.likelihood.sampled_errors(judged.hyper(map));
        let sampled = errors.and_then(|errors| Sampled::of(errors, &jacobian));
        Self { judged, jacobian, covariance, gradient, sampled }
    }

    /// Effect of errors, one per row and times a factor, on the estimates of the study's parameters.
    fn effect(&self, errors: &Matrix, factor: f64, allowed: bool) -> Effect {
        let step = errors.rows().div_ceil(MOST).max(1);
        let rows: Vec<usize> = (0..errors.rows()).step_by(step).collect();
        let parameters = &self.judged.study.parameters;
        let mut squares = vec![0.0; parameters.len()];
        for &row in &rows {
            let error: Vec<f64> = errors.row(row).iter().map(|e| factor * e).collect();
            let score = self.score(&error);
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

    /// Change of the score of the data by an error of the response.
    fn score(&self, error: &[f64]) -> Vec<f64> {
        let judged = self.judged;
        if let Some(sampled) = &self.sampled {
            return transposed_multiply_vector(&sampled.weights, error);
        }
        let wrong: Vec<f64> = judged.response.iter().zip(error).map(|(r, e)| r + e).collect();
        let hyper = judged.hyper(&judged.calibrated.outcome.map);
        let gradient = judged.likelihood.gradient(&wrong, hyper).0;
        let change: Vec<f64> = gradient.iter().zip(&self.gradient).map(|(a, b)| a - b).collect();
        transposed_multiply_vector(&self.jacobian, &change)
    }

    /// Finding about the directions that the discrepancy omits.
    fn left_out(&self, sampled: &Sampled) -> Option<Finding> {
        let scores = transposed_multiply(&sampled.weights, &sampled.left_out);
        let shifts = multiply(&self.covariance, &scores);
        let shift = |j: usize| {
            let square: f64 = shifts.row(j).iter().map(|x| x * x).sum();
            (square / self.covariance[(j, j)]).sqrt()
        };
        let parameters = self.judged.study.parameters.iter().enumerate();
        let shifts: Vec<(String, f64)> =
            parameters.map(|(j, p)| (p.name.clone(), shift(j))).collect();
        check::sampled(&shifts, sampled.directions)
    }

    fn against_noise(&self, errors: &Matrix, factor: f64) -> Option<f64> {
        let summaries = self.judged.measured.used.summaries();
        let ratio = |(j, s): (usize, &lacuna::data::measurements::Summary)| {
            let error = s.sd()? / (s.count as f64).sqrt();
            (error > 0.0).then(|| factor * root_mean_square(&errors.column(j)) / error)
        };
        let ratios: Vec<f64> = summaries.iter().enumerate().filter_map(ratio).collect();
        (!ratios.is_empty()).then(|| moments::quantile(&moments::sorted(&ratios), 0.5))
    }
}
