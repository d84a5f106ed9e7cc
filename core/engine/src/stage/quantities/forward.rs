//! Propagation of the priors of a study without data: response and quantities, and the shares of the parameters in their
//! variance.

use lacuna::math::moments::{mean, quantile, sorted, variance};
use lacuna::math::random::Stream;
use lacuna::plugin::Forward;
use lacuna::run::{Progress, Stop};
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::bounds::{self, BoundsFindings};
use super::inputs::PropagatedInputs;
use super::{Basis, Quantified, Work};
use crate::sensitivity::{Indices, evaluations, indices};
use crate::stage::inverse_problem::{InverseProblem, Route};
use crate::stage::predict;
use crate::stage::prediction_errors::Errors;
use crate::stage::predictions::Chosen;
use crate::study::Study;
use crate::study::quantity::in_default;

/// Consequences of the priors of a study besides the draws of its quantities.
#[derive(Debug, Clone, PartialEq)]
pub struct Propagated {
    /// Names of the inputs with distributions: the parameters, then the unknowns of effects.
    pub inputs: Vec<String>,
    /// Number of samples of the indices.
    pub samples: usize,
    /// Sensitivity of the quantities, without errors.
    pub quantities: Indices,
    /// Sensitivity of the response, output by output, without errors.
    pub response: Indices,
    /// Distribution of the response with the errors of emulator and numerics.
    pub bands: Bands,
    /// Bounds of the quantities over the intervals of parameters. All else is given with these parameters at the middle of
    /// their intervals.
    pub bounds: Option<BoundsFindings>,
}

/// Figures of the response, output by output.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Bands {
    /// Mean.
    pub mean: Vec<f64>,
    /// Standard deviation.
    pub sd: Vec<f64>,
    /// 2.5 % quantile.
    pub q025: Vec<f64>,
    /// Median.
    pub median: Vec<f64>,
    /// 97.5 % quantile.
    pub q975: Vec<f64>,
}

/// Number of runs of the model that the propagation makes, at most if there are intervals, in a study that has neither data
/// nor a surrogate.
pub fn runs(study: &Study) -> Option<usize> {
    let draws = study.propagated().filter(|_| study.surrogate.is_none())?;
    let of_laws = match PropagatedInputs::of(study).laws.len() {
        0 => 1,
        count => evaluations(count, true, draws),
    };
    let each = of_laws.saturating_add(bounds::evaluations(study, draws)).saturating_add(1);
    Some(each.saturating_mul(study.scenarios.len().max(1)))
}

/// Propagates the priors, and bounds the quantities over the intervals.
pub(super) fn propagate(
    study: &Study,
    problem: &InverseProblem<'_>,
    samples: usize,
    progress: &Progress<'_>,
) -> Result<Quantified, Stop> {
    let inputs = PropagatedInputs::of(study);
    let errors = Errors::of_priors(study, problem)?;
    let forward = problem.forward();
    let work = Work::new(study, Some(forward), errors, progress);
    let stream = work.random.named("prior");
    let outputs = forward.outputs();
    let (both, held) = evaluated(&work, &inputs, samples, &stream);
    if let Some(reason) = forward.failure() {
        return Err(Stop::new(reason));
    }
    if held.iter().flatten().all(|value| value.is_nan()) {
        return Err(Stop::new("the model has a response at no draw of the priors"));
    }
    let count = held.len();
    let points = Matrix::from_rows(
        inputs.middle.len(),
        (0..count).map(|i| inputs.draw(&stream.at(i as u64))),
    );
    let chosen = Chosen {
        chains: vec![0],
        steps: (0..count).collect(),
        points: points.clone(),
        efficiency: 1.0,
        written: true,
    };
    let centre = inputs.middle.clone();
    let basis = Basis { centre, efficiency: 1.0, responses: Some(&held) };
    let made = work.predict(&basis, chosen)?;
    let bands = bands(&work, held, &points);
    let [response, quantities] = both.split(outputs);
    let bounds = bounds::bounds(&work, &inputs, samples, &stream);
    if let Some(reason) = forward.failure() {
        return Err(Stop::new(reason));
    }
    let inputs = inputs.names;
    let propagated = Propagated { inputs, samples, quantities, response, bands, bounds };
    Ok(Quantified { propagated: Some(propagated), ..made })
}

/// Sensitivity of response and quantities, and the responses at the first points of the samples, as many as can be held. If
/// no input has a distribution the response is one, and stands once for each draw of the errors.
fn evaluated(
    work: &Work<'_>,
    inputs: &PropagatedInputs,
    samples: usize,
    stream: &Stream,
) -> (Indices, Vec<Vec<f64>>) {
    let outputs = work.forward.map_or(0, Forward::outputs);
    let count = predict::affordable(samples, outputs);
    if inputs.laws.is_empty() {
        let points = Matrix::from_vec(1, inputs.middle.len(), inputs.middle.clone());
        let alike = if work.errors.is_none() { 1 } else { count };
        let response = work.responses(&points).swap_remove(0);
        return (Indices::none(0), vec![response; alike]);
    }
    let mut held: Vec<Vec<f64>> = Vec::new();
    let keep = |i: usize, values: &[f64]| {
        if i < count {
            held.push(values[..outputs].to_vec());
        }
    };
    let everything = |points: &Matrix| work.everything(&inputs.full_rows(points));
    let both = indices(&inputs.independent(), samples, stream, everything, keep);
    (both, held)
}

/// States how many times the model itself will be run.
pub(super) fn announcement(study: &Study, problem: &InverseProblem<'_>) -> Option<String> {
    matches!(problem.route, Route::Direct(_)).then_some(())?;
    let runs = runs(study)?;
    Some(if study.intervals().is_empty() {
        format!(
            "the priors are propagated with {runs} runs of the model; `forward.draws` sets their number, and a `[surrogate]` \
             needs fewer"
        )
    } else {
        format!(
            "priors and intervals are propagated with at most {runs} runs of the model; `forward.draws` and \
             `forward.intervals` set their number, and a `[surrogate]` needs fewer"
        )
    })
}

impl Work<'_> {
    /// The response and all quantities at some points, without errors.
    fn everything(&self, points: &Matrix) -> Matrix {
        let responses = self.responses(points);
        let rows: Vec<usize> = (0..points.rows()).collect();
        let one = |&i: &usize| {
            let place = self.place(points.row(i), &responses[i]);
            let values = self.evaluated(&place, &[], |_, _| true);
            [&responses[i][..], &values[..]].concat()
        };
        let all: Vec<Vec<f64>> = rows.par_iter().map(one).collect();
        let columns = all.first().map_or(0, Vec::len);
        Matrix::from_rows(columns, all)
    }

    /// A response with one draw of the errors that predictions contain by default.
    fn with_errors(&self, mut response: Vec<f64>, point: &[f64], random: &Stream) -> Vec<f64> {
        for path in self.errors.draw(&response, point, random) {
            if in_default(path.origin.as_str()) {
                response.iter_mut().zip(&path.values).for_each(|(y, e)| *y += e);
            }
        }
        response
    }
}

/// Figures of the response at draws, with their errors.
fn bands(work: &Work<'_>, held: Vec<Vec<f64>>, points: &Matrix) -> Bands {
    let one = |(i, response): (usize, Vec<f64>)| {
        work.with_errors(response, points.row(i), &work.random.at(i as u64))
    };
    let all: Vec<Vec<f64>> = held.into_par_iter().enumerate().map(one).collect();
    let outputs = all.first().map_or(0, Vec::len);
    let figures = |j: usize| {
        let values: Vec<f64> = all.iter().map(|r| r[j]).filter(|y| y.is_finite()).collect();
        let ordered = sorted(&values);
        let [low, middle, high] = [0.025, 0.5, 0.975].map(|p| quantile(&ordered, p));
        // One value has no variance.
        let square = if values.len() == 1 { 0.0 } else { variance(&values) };
        [mean(&values), square.sqrt(), low, middle, high]
    };
    let found: Vec<[f64; 5]> = (0..outputs).into_par_iter().map(figures).collect();
    let [mean, sd, q025, median, q975] =
        [0, 1, 2, 3, 4].map(|k| found.iter().map(|figures| figures[k]).collect());
    Bands { mean, sd, q025, median, q975 }
}
