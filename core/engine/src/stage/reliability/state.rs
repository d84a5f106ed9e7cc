//! Limit states of a study: of its priors, and of its posterior.

use std::sync::atomic::{AtomicUsize, Ordering};

use lacuna::data::Parameter;
use lacuna::math::moments::mean;
use lacuna::math::random::{Stream, normal};
use lacuna::math::special::normal_cdf;
use lacuna::plugin::discrepancy::ErrorPath;
use lacuna::plugin::reliability::LimitState;
use lacuna::plugin::{Forward, Target};
use lacuna::run::Stop;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix};
use rayon::prelude::*;

use crate::posterior::Posterior;
use crate::stage::calibrate::Calibrated;
use crate::stage::inverse_problem::InverseProblem;
use crate::stage::predict;
use crate::stage::prediction_errors::{ErrorVariables, Errors};
use crate::study::Study;
use crate::study::derived::Derived;
use crate::study::quantity::{Asked, needed};
use crate::study::reliability::Event;

/// Evaluation of the quantities of a study at points of its unknowns.
pub struct Evaluation<'a> {
    study: &'a Study,
    forward: Option<&'a dyn Forward>,
    /// The values that the study asks for.
    pub asked: Vec<Asked>,
    derived: Vec<Derived>,
    /// Range of the simulation runs of the emulator in each parameter; empty without an emulator.
    ranges: Vec<(f64, f64)>,
    /// Number of points evaluated so far at which the event occurs, and of those beyond the ranges.
    occurred: [AtomicUsize; 2],
}

impl<'a> Evaluation<'a> {
    /// The quantities of a study with a response.
    pub fn new(study: &'a Study, problem: &'a InverseProblem<'_>) -> Self {
        Self {
            forward: Some(problem.forward()),
            ranges: ranges(study, problem),
            ..Self::of_numbers(study)
        }
    }

    /// The quantities of a study without a response.
    pub fn of_numbers(study: &'a Study) -> Self {
        let (asked, derived) = (study.asked(), study.derived());
        let occurred = [AtomicUsize::new(0), AtomicUsize::new(0)];
        Self { study, forward: None, asked, derived, ranges: Vec::new(), occurred }
    }

    /// The number of points at which the event occurred since the last call, and of those beyond the runs of the emulator.
    pub fn taken(&self) -> [usize; 2] {
        [0, 1].map(|i| self.occurred[i].swap(0, Ordering::Relaxed))
    }

    /// The errors that the value of an event contains, as further variables.
    pub fn variables<'e>(
        &self,
        event: &Event,
        errors: &'e Errors,
    ) -> Result<ErrorVariables<'e>, Stop> {
        let needed = needed(&self.asked, event.value);
        let asked = || self.asked.iter().zip(&needed).filter(|(_, needed)| **needed);
        let included = |origin: &str| asked().any(|(asked, _)| asked.includes(origin));
        let outputs: Vec<usize> =
            asked().flat_map(|(asked, _)| asked.outputs().iter().copied()).collect();
        ErrorVariables::of(errors, included, &outputs)
            .map_err(|error| Stop::new(format!("the errors of the prediction: {error}")))
    }

    /// Returns true if a point lies beyond the runs of the emulator.
    pub fn is_beyond(&self, point: &[f64]) -> bool {
        self.ranges.iter().zip(point).any(|((low, high), x)| x < low || x > high)
    }

    /// Limit state of an event at natural points, one per row, with errors at these values of their variables.
    fn values(
        &self,
        event: &Event,
        points: &Matrix,
        (errors, variables): (&ErrorVariables<'_>, &Matrix),
    ) -> Result<Vec<f64>, Stop> {
        let responses = match self.forward {
            Some(forward) => predict::responses(self.study, forward, points),
            None => vec![Vec::new(); points.rows()],
        };
        if let Some(reason) = self.forward.and_then(Forward::failure) {
            return Err(Stop::new(reason));
        }
        let needed = needed(&self.asked, event.value);
        let one = |i: usize| {
            let (point, response) = (points.row(i), &responses[i]);
            let derived: Vec<f64> = self.derived.iter().map(|d| d.value(point)).collect();
            let paths = errors.paths(response, point, variables.row(i));
            let mut values: Vec<f64> = Vec::with_capacity(event.value + 1);
            for (asked, needed) in self.asked.iter().zip(&needed) {
                let own: Vec<&ErrorPath> =
                    paths.iter().filter(|path| asked.includes(path.origin.as_str())).collect();
                let with =
                    |i: usize| response[i] + own.iter().map(|path| path.values[i]).sum::<f64>();
                let context = (point, &derived[..], &values[..]);
                let value = if *needed { asked.value(with, context) } else { f64::NAN };
                values.push(value);
            }
            let value = values[event.value];
            let state = if event.above { event.limit - value } else { value - event.limit };
            if state <= 0.0 {
                self.occurred[0].fetch_add(1, Ordering::Relaxed);
                self.occurred[1].fetch_add(self.is_beyond(point).into(), Ordering::Relaxed);
            }
            state
        };
        Ok((0..points.rows()).into_par_iter().map(one).collect())
    }
}

/// The range of the simulation runs in each parameter; empty without an emulator.
fn ranges(study: &Study, problem: &InverseProblem<'_>) -> Vec<(f64, f64)> {
    let Some(runs) = problem.data.value.ensemble.as_ref().filter(|_| problem.emulator().is_some())
    else {
        return Vec::new();
    };
    let range = |name: &String| {
        let column = runs.parameters.iter().position(|other| other == name);
        column.map_or((f64::NEG_INFINITY, f64::INFINITY), |j| {
            let values = runs.points.column(j);
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            (low, values.into_iter().fold(f64::NEG_INFINITY, f64::max))
        })
    };
    study.parameters.iter().map(|parameter| range(&parameter.name)).collect()
}

/// Limit state of independent priors: each variable is mapped through the inverse distribution function of a prior; those of
/// the errors follow.
pub struct OfPrior<'a> {
    pub evaluation: &'a Evaluation<'a>,
    pub event: Event,
    pub parameters: &'a [Parameter],
    pub errors: ErrorVariables<'a>,
}

/// Largest variable that is mapped: beyond it the distribution function rounds to one.
const FARTHEST: f64 = 8.0;

impl OfPrior<'_> {
    /// Parameters at a point of the variables.
    pub fn natural(&self, point: &[f64]) -> Vec<f64> {
        let pairs = self.parameters.iter().zip(point);
        pairs.map(|(p, u)| p.prior.quantile(normal_cdf(u.clamp(-FARTHEST, FARTHEST)))).collect()
    }
}

impl LimitState for OfPrior<'_> {
    fn dimension(&self) -> usize {
        self.parameters.len() + self.errors.count()
    }

    fn values(&self, points: &Matrix) -> Result<Vec<f64>, Stop> {
        let own = self.parameters.len();
        let natural = Matrix::from_rows(own, points.iter_rows().map(|u| self.natural(u)));
        let errors = (&self.errors, &columns_after(own, points));
        self.evaluation.values(&self.event, &natural, errors)
    }
}

/// Columns of the points from this one on.
fn columns_after(first: usize, points: &Matrix) -> Matrix {
    Matrix::from_rows(points.columns() - first, points.iter_rows().map(|row| &row[first..]))
}

/// Limit state of a posterior: an affine map with the mean and the covariance of the draws, and a weight that makes it exact.
/// The variables of the errors follow, which are independent of it.
pub struct OfPosterior<'a> {
    evaluation: &'a Evaluation<'a>,
    event: Event,
    posterior: &'a Posterior<'a>,
    centre: Vec<f64>,
    factor: Cholesky,
    draws: Matrix,
    errors: ErrorVariables<'a>,
}

/// Smallest and largest number of draws of the first level.
const DRAWS: [usize; 2] = [500, 20_000];

impl<'a> OfPosterior<'a> {
    /// The limit state, with as many draws as are about independent.
    pub fn new(
        evaluation: &'a Evaluation<'a>,
        event: Event,
        posterior: &'a Posterior<'a>,
        calibrated: &Calibrated,
        (errors, stream): (ErrorVariables<'a>, &Stream),
    ) -> Result<Self, Stop> {
        let draws = calibrated.draws.from_step(calibrated.outcome.burn_in);
        let judged = &calibrated.outcome.diagnosis.coordinates;
        let size = mean(&judged.iter().map(|j| j.ess_bulk).collect::<Vec<_>>());
        let size = if size.is_finite() { size as usize } else { DRAWS[0] };
        let count = size.clamp(DRAWS[0], DRAWS[1]).min(draws.len());
        let place = |i: usize| draws.point(i % draws.chains, i / draws.chains);
        let rows: Vec<Vec<f64>> = predict::spaced(count, draws.len())
            .into_iter()
            .map(|i| posterior.coordinates(place(i)))
            .collect();
        let points = Matrix::from_rows(draws.dimension(), &rows);
        let (centre, covariance) = spread(&points);
        let factor = Cholesky::new(&covariance).map_err(|_| {
            Stop::new("the draws of the posterior have no covariance of full rank")
                .help("draw more samples")
        })?;
        let mut rng = stream.named("errors").generator();
        let white = |row: &[f64]| {
            let mut row: Vec<f64> = row.iter().zip(&centre).map(|(x, m)| x - m).collect();
            factor.whiten(&mut row);
            row.extend((0..errors.count()).map(|_| normal(&mut rng)));
            row
        };
        let dimension = centre.len() + errors.count();
        let draws = Matrix::from_rows(dimension, points.iter_rows().map(white));
        Ok(Self { evaluation, event, posterior, centre, factor, draws, errors })
    }

    fn coordinates(&self, point: &[f64]) -> Vec<f64> {
        self.factor
            .colour(&point[..self.centre.len()])
            .iter()
            .zip(&self.centre)
            .map(|(x, m)| x + m)
            .collect()
    }

    /// Unknowns at a point of the variables, in natural units.
    pub fn natural(&self, point: &[f64]) -> Vec<f64> {
        self.posterior.natural(&self.coordinates(point))
    }
}

impl LimitState for OfPosterior<'_> {
    fn dimension(&self) -> usize {
        self.centre.len() + self.errors.count()
    }

    fn values(&self, points: &Matrix) -> Result<Vec<f64>, Stop> {
        let own = self.centre.len();
        let natural = Matrix::from_rows(own, points.iter_rows().map(|u| self.natural(u)));
        let errors = (&self.errors, &columns_after(own, points));
        self.evaluation.values(&self.event, &natural, errors)
    }

    fn is_standard_normal(&self) -> bool {
        false
    }

    fn log_weights(&self, points: &Matrix) -> Vec<f64> {
        let rows = points.iter_rows().map(|u| self.coordinates(u));
        let own = self.centre.len();
        let density = self.posterior.log_density(&Matrix::from_rows(own, rows));
        let square = |u: &[f64]| dot(&u[..own], &u[..own]);
        density.iter().zip(points.iter_rows()).map(|(p, u)| p + 0.5 * square(u)).collect()
    }

    fn draws(&self) -> Option<&Matrix> {
        Some(&self.draws)
    }
}

/// Mean and covariance of the rows.
fn spread(points: &Matrix) -> (Vec<f64>, Matrix) {
    let d = points.columns();
    let centre: Vec<f64> = (0..d).map(|j| mean(&points.column(j))).collect();
    let n = (points.rows().max(2) - 1) as f64;
    let sum = |i: usize, j: usize| {
        points.iter_rows().map(|x| (x[i] - centre[i]) * (x[j] - centre[j])).sum::<f64>() / n
    };
    let covariance = Matrix::from_fn(d, d, sum);
    (centre, covariance)
}
