//! Fit of directions and expansions, judged by runs that were left out of both.

use lacuna::math::random::{Stream, permutation};
use lacuna::plugin::Forward as _;
use lacuna::plugin::forward::Linear as _;
use lacuna::plugin::surrogate::{FitError, Training};
use lacuna::run::{Progress, Silent, Stop};
use lacuna_linalg::{Matrix, multiply_transposed};
use rayon::prelude::*;

use super::PartialLeastSquares;
use super::directions::directions;
use super::emulator::{Component, Reduced};
use super::inputs::{Input, along, positions, scaled};
use crate::surrogates::polynomial_chaos::{Basis, Expansion, check_numbers};
use crate::surrogates::principal_components::PrincipalComponents;

/// Number of consecutive directions that were worse than the best number before the search ends.
const WORSE: usize = 2;
/// Smallest number of runs: with one left out, an expansion needs three.
const LEAST_RUNS: usize = 4;
/// Standard deviation over the runs, as a fraction of the largest response, below which an output counts as constant.
const ROUND_OFF: f64 = 1e-13;
/// Relative error above which the fit is reported as poor.
const POOR: f64 = 0.5;

pub(super) fn fit(
    options: &PartialLeastSquares,
    training: &Training<'_>,
    stream: &Stream,
    progress: &Progress<'_>,
) -> Result<Reduced, Stop> {
    check_numbers(training)?;
    let runs = training.points.rows();
    if let Some((key, message)) = options.faults(Some(runs)).into_iter().next() {
        return Err(Stop::new(format!("`surrogate.{key}`: {message}")));
    }
    if runs < LEAST_RUNS {
        return Err(Stop::new(format!(
            "`partial_least_squares` needs at least {LEAST_RUNS} runs, but there are {runs}"
        )));
    }
    let inputs: Vec<Input> = training
        .parameters
        .iter()
        .map(Input::of)
        .collect::<Result<_, _>>()
        .map_err(|message| Stop::new(format!("`surrogate.use`: {message}")))?;
    let parts = options.components.of(training.responses)?;
    let problem = Problem {
        options,
        training,
        stream,
        folds: folds(options.folds.min(runs), runs, stream),
        scaled: scaled(&inputs, training.points),
        inputs: &inputs,
    };
    let found: Vec<Found> = (0..parts.scores.columns())
        .into_par_iter()
        .map(|c| problem.component(&parts.scores.column(c), progress))
        .collect::<Result<_, Stop>>()?;
    let fit_error = fit_error(training.responses, &parts, &found);
    warn(&fit_error, progress);
    let loadings = Matrix::from_fn(parts.scores.columns() + 1, parts.mean.len(), |c, j| match c {
        0 => parts.mean[j],
        c => parts.directions[(j, c - 1)],
    });
    let components = found.into_iter().map(|found| found.component).collect();
    let folds = problem.folds.len();
    Ok(Reduced { inputs, components, loadings, folds, fit_error })
}

/// Divides the runs into groups at random.
fn folds(count: usize, runs: usize, stream: &Stream) -> Vec<Vec<usize>> {
    let order = permutation(&mut stream.named("folds").generator(), runs);
    (0..count).map(|f| order.iter().copied().skip(f).step_by(count).collect()).collect()
}

/// Data shared by the fits of all components.
struct Problem<'a> {
    options: &'a PartialLeastSquares,
    training: &'a Training<'a>,
    stream: &'a Stream,
    folds: Vec<Vec<usize>>,
    /// Scaled inputs (`runs x inputs`).
    scaled: Matrix,
    inputs: &'a [Input],
}

/// Fit of one component.
struct Found {
    component: Component,
    /// Residual of each run for directions and expansion found without it.
    residuals: Vec<f64>,
}

/// Directions found without one group of runs.
struct Part<'a> {
    left: &'a [usize],
    others: Vec<usize>,
    values: Vec<f64>,
    scaled: Matrix,
    directions: Matrix,
}

impl Problem<'_> {
    fn component(&self, values: &[f64], progress: &Progress<'_>) -> Result<Found, Stop> {
        let most = self.options.max_directions;
        let parts: Vec<Part<'_>> =
            self.folds.par_iter().map(|left| self.part(left, values, most)).collect();
        let all = self.directions(&self.scaled, values, most);
        let mut best: Option<(f64, usize, Vec<f64>)> = None;
        let mut worse = 0;
        for count in 1..=all.columns() {
            let residuals = self.left_out(&parts, values, count)?;
            let error = residuals.iter().map(|r| r * r).sum::<f64>();
            if best.as_ref().is_none_or(|(least, ..)| error < *least) {
                best = Some((error, count, residuals));
                worse = 0;
            } else {
                worse += 1;
            }
            if worse >= WORSE {
                break;
            }
        }
        let (_, count, residuals) = best.ok_or_else(unexplained)?;
        let directions = first(&all, count);
        let expansion = self.expand(&self.scaled, &directions, values)?;
        progress.add(1);
        let coordinates = expansion.basis_coordinates();
        let component = Component {
            basis: Basis::new(coordinates, expansion.terms().clone()),
            coefficients: expansion.coefficients().column(0),
            directions,
        };
        Ok(Found { component, residuals })
    }

    fn directions(&self, scaled: &Matrix, values: &[f64], most: usize) -> Matrix {
        directions(scaled, values, most, self.options.refinements)
    }

    fn part<'f>(&self, left: &'f [usize], values: &[f64], most: usize) -> Part<'f> {
        let mut is_left = vec![false; values.len()];
        left.iter().for_each(|&i| is_left[i] = true);
        let others: Vec<usize> = (0..values.len()).filter(|&i| !is_left[i]).collect();
        let own: Vec<f64> = others.iter().map(|&i| values[i]).collect();
        let scaled = self.scaled.select_rows(&others);
        let directions = self.directions(&scaled, &own, most);
        Part { left, others, values: own, scaled, directions }
    }

    /// Returns the residual of each run for `count` directions, found without its group.
    fn left_out(
        &self,
        parts: &[Part<'_>],
        values: &[f64],
        count: usize,
    ) -> Result<Vec<f64>, Stop> {
        let of_part = |part: &Part<'_>| -> Result<Vec<f64>, Stop> {
            let directions = first(&part.directions, count);
            if directions.columns() == 0 {
                let mean = part.values.iter().sum::<f64>() / part.others.len() as f64;
                return Ok(part.left.iter().map(|&i| values[i] - mean).collect());
            }
            let expansion = self.expand(&part.scaled, &directions, &part.values)?;
            let places = positions(&self.scaled.select_rows(part.left), &directions);
            let mean = expansion.mean(&places);
            Ok(part.left.iter().enumerate().map(|(k, &i)| values[i] - mean[(k, 0)]).collect())
        };
        let found: Vec<Vec<f64>> = parts.par_iter().map(of_part).collect::<Result<_, Stop>>()?;
        let mut residuals = vec![0.0; values.len()];
        for (part, left) in parts.iter().zip(found) {
            part.left.iter().zip(left).for_each(|(&i, r)| residuals[i] = r);
        }
        Ok(residuals)
    }

    /// Fits the expansion in the positions along directions.
    fn expand(&self, scaled: &Matrix, axes: &Matrix, values: &[f64]) -> Result<Expansion, Stop> {
        let points = positions(scaled, axes);
        let responses = Matrix::from_vec(values.len(), 1, values.to_vec());
        let training = Training {
            parameters: &along(self.inputs, axes),
            layouts: self.training.layouts,
            points: &points,
            responses: &responses,
        };
        let stream = self.stream.named("expansion");
        self.options.expansion().expand(&training, &stream, &Progress::new(&Silent))
    }
}

/// Returns the first columns, at most as many as there are.
fn first(directions: &Matrix, count: usize) -> Matrix {
    let columns: Vec<usize> = (0..count.min(directions.columns())).collect();
    directions.select_columns(&columns)
}

/// Returns the errors of the outputs at left-out runs, including the part that the components leave out.
fn fit_error(responses: &Matrix, parts: &PrincipalComponents, found: &[Found]) -> FitError {
    let (runs, outputs) = (responses.rows(), responses.columns());
    let of_scores = Matrix::from_fn(runs, found.len(), |i, c| found[c].residuals[i]);
    let product = multiply_transposed(&of_scores, &parts.directions);
    let residuals =
        Matrix::from_fn(runs, outputs, |i, j| product[(i, j)] + parts.remainder[(i, j)]);
    let largest = responses.as_slice().iter().fold(0.0_f64, |most, y| most.max(y.abs()));
    let relative = (0..outputs)
        .map(|j| {
            let centred = |i: usize| responses[(i, j)] - parts.mean[j];
            let variance = (0..runs).map(|i| centred(i).powi(2)).sum::<f64>() / runs as f64;
            let error = residuals.column(j).iter().map(|r| r * r).sum::<f64>() / runs as f64;
            if variance.sqrt() > ROUND_OFF * largest { error / variance } else { 0.0 }
        })
        .collect();
    FitError { relative, residuals }
}

/// Warns of outputs that a few directions do not explain.
fn warn(fit_error: &FitError, progress: &Progress<'_>) {
    let outputs = fit_error.relative.len();
    let poor = fit_error.relative.iter().filter(|error| **error >= POOR).count();
    if poor > 0 {
        progress.warn(&format!(
            "{poor} of {outputs} outputs are not explained by a few directions of the parameters: at left-out runs \
             half of their variance or more remains; `polynomial_chaos` and `gaussian_process` need no such directions"
        ));
    }
}

fn unexplained() -> Stop {
    Stop::new("the responses vary over the runs, but no direction of the parameters covaries with them")
        .help("check that the runs' parameters and responses belong together, or use `polynomial_chaos`")
}
