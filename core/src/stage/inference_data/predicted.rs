//! What the file holds beside the draws: log-likelihoods, and data drawn from posterior and prior.

use rayon::prelude::*;

use crate::data::Measurements;
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::{Likelihood, Target};
use crate::posterior::Posterior;
use crate::run::Stop;
use crate::stage::calibrate::Calibrated;
use crate::stage::predictions::{self, Chosen, Predicting};
use crate::stage::{predict, stream};
use crate::study::Study;

/// What says how probable the measured data are, and what makes new ones.
pub struct Predictor<'a> {
    /// The densities of the measured data.
    pub densities: Predicting<'a>,
    /// What makes data about a response.
    pub makes: &'a dyn Likelihood,
}

/// Draws from the prior, in natural units, one a row.
pub struct FromPrior {
    /// The draws.
    pub points: Matrix,
    /// Data at those of them where the model has an answer, one set a row; with the numbers of these draws.
    pub data: Option<(Vec<usize>, Matrix)>,
}

/// The number of draws from the prior.
const PRIOR: usize = 500;

/// Predictions at draws of the posterior.
pub struct FromPosterior {
    /// The draws.
    pub chosen: Chosen,
    /// The log density of each datum given all others, `draws x data`, where the discrepancy has it.
    pub log_likelihood: Option<Matrix>,
    /// Data like those that were measured, one set a row.
    pub data: Matrix,
}

/// Predictions at draws of the posterior; `None` where they are too many to be written.
pub fn from_posterior(
    study: &Study,
    p: &Predictor<'_>,
    calibrated: &Calibrated,
) -> Result<Option<FromPosterior>, Stop> {
    let chosen = Chosen::of(calibrated, p.densities.data.count());
    if !chosen.written || chosen.points.rows() == 0 {
        return Ok(None);
    }
    let held = predictions::responses(study, &p.densities, &chosen);
    let log_likelihood = predictions::pointwise(study, &p.densities, &chosen, held.as_deref());
    let responses =
        held.unwrap_or_else(|| predict::responses(study, p.densities.forward, &chosen.points));
    if let Some(reason) = p.densities.forward.failure() {
        return Err(Stop::new(reason));
    }
    let random = stream(study, "posterior_predictive");
    let data = simulated(p, &responses, &chosen.points, &random);
    Ok(Some(FromPosterior { chosen, log_likelihood, data }))
}

/// Draws from the prior, with data where there is something that predicts them.
pub fn from_prior(
    study: &Study,
    posterior: &Posterior<'_>,
    p: Option<&Predictor<'_>>,
) -> Result<FromPrior, Stop> {
    let random = stream(study, "prior");
    let coordinates = posterior.prior_draws(PRIOR, &random);
    let natural = coordinates.iter_rows().map(|row| posterior.natural(row));
    let points = Matrix::from_rows(coordinates.columns(), natural);
    let Some(p) = p else { return Ok(FromPrior { points, data: None }) };
    let count = predictions::from_prior(p.densities.data.count()).min(points.rows());
    let first = points.select_rows(&(0..count).collect::<Vec<_>>());
    let responses = predict::responses(study, p.densities.forward, &first);
    if let Some(reason) = p.densities.forward.failure() {
        return Err(Stop::new(reason));
    }
    let answered: Vec<usize> =
        (0..count).filter(|&i| responses[i].iter().all(|y| y.is_finite())).collect();
    let responses: Vec<Vec<f64>> = answered.iter().map(|&i| responses[i].clone()).collect();
    let data = simulated(p, &responses, &first.select_rows(&answered), &random);
    let data = (!answered.is_empty()).then_some((answered, data));
    Ok(FromPrior { points, data })
}

/// One set of data a row, in the order of the measured ones.
fn simulated(
    p: &Predictor<'_>,
    responses: &[Vec<f64>],
    points: &Matrix,
    random: &Stream,
) -> Matrix {
    let (own, count) = (p.makes.hyperparameters().len(), p.densities.data.count());
    let one = |(i, response): (usize, &Vec<f64>)| -> Vec<f64> {
        let point = points.row(i);
        let hyper = &point[point.len() - own..];
        let blocks = p.makes.simulate(response, hyper, &random.named("data").at(i as u64));
        let values = |block: &Measurements| -> Vec<f64> {
            block.replicates.iter().flat_map(|r| r.values.iter().flatten()).copied().collect()
        };
        let all: Vec<f64> = blocks.iter().flat_map(values).collect();
        // A discrepancy in a library that fails says so by itself.
        if all.len() == count { all } else { vec![f64::NAN; count] }
    };
    let rows: Vec<Vec<f64>> = responses.par_iter().enumerate().map(one).collect();
    Matrix::from_rows(count, rows)
}
