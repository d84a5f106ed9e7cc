//! Contents of the file besides the draws: log-likelihoods, and data simulated from posterior and prior.

use lacuna::plugin::Target;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::posterior::Posterior;
use crate::stage::calibrate::Calibrated;
use crate::stage::pieces::Pieces;
use crate::stage::predictions::{self, Chosen, Predictor};
use crate::stage::{predict, stream};
use crate::study::Study;

/// Draws from the prior, in natural units, one per row.
pub struct FromPrior {
    /// The draws, `draws x coordinates`.
    pub points: Matrix,
    /// Indices of the draws at which the model has a response, and the data simulated there, one set per row.
    pub data: Option<(Vec<usize>, Matrix)>,
}

/// Number of draws from the prior.
const PRIOR: usize = 500;

/// Predictions at draws from the posterior.
pub struct FromPosterior {
    /// Selected draws.
    pub chosen: Chosen,
    /// Log density of each datum given all others, `draws x data`, if the discrepancy supports it.
    pub log_likelihood: Option<Matrix>,
    /// Simulated data (posterior predictive), one set per row.
    pub data: Matrix,
}

/// Predictions at draws from the posterior; `None` if there are too many to write.
pub fn from_posterior(
    study: &Study,
    p: &Predictor<'_>,
    calibrated: &Calibrated,
) -> Result<Option<FromPosterior>, Stop> {
    let chosen = Chosen::of(calibrated, p.densities.data.count());
    if !chosen.written || chosen.points.rows() == 0 {
        return Ok(None);
    }
    let mut pieces = Pieces::unkept();
    let held = predictions::responses(study, &p.densities, &chosen, &mut pieces)?;
    let log_likelihood =
        predictions::pointwise(study, &p.densities, &chosen, held.as_deref(), &mut pieces)?;
    let responses =
        held.unwrap_or_else(|| predict::responses(study, p.densities.forward, &chosen.points));
    if let Some(reason) = p.densities.forward.failure() {
        return Err(Stop::new(reason));
    }
    let data = predictions::simulated_from_posterior(study, p, &responses, &chosen.points);
    Ok(Some(FromPosterior { chosen, log_likelihood, data }))
}

/// Draws from the prior, with simulated data if there is a likelihood.
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
    let data = predictions::simulated(p, &responses, &first.select_rows(&answered), &random);
    let data = (!answered.is_empty()).then_some((answered, data));
    Ok(FromPrior { points, data })
}
