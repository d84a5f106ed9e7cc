//! Where the search for the best fit and the chains start.

use crate::linalg::Matrix;
use crate::math::distribution::Distribution;
use crate::math::random::Stream;
use crate::math::{optimise, sobol};
use crate::plugin::Target;
use crate::posterior::Posterior;
use crate::run::Stop;

/// Number of prior draws among which the starting points of the optimiser are chosen.
const CANDIDATES: usize = 400;
/// Number of starting points of the optimiser.
const STARTS: usize = 12;

/// The local maxima of the posterior density in natural units, best first.
pub(super) fn maxima(
    posterior: &Posterior<'_>,
    stream: &Stream,
) -> Result<Vec<optimise::Optimum>, Stop> {
    let mode = posterior.mode();
    let d = posterior.parameters().len();
    let mut candidates = posterior.prior_draws(CANDIDATES, stream);
    // A discrepancy knows a sensible start for its own unknowns; a wide prior on a variance does not.
    let starts: Vec<f64> = posterior.hyperparameters().iter().map(|h| h.start).collect();
    let filled = [vec![1.0; d], starts].concat();
    let hyper = posterior.coordinates(&filled)[d..].to_vec();
    for i in 0..candidates.rows() {
        candidates.row_mut(i)[d..].copy_from_slice(&hyper);
    }
    let density = mode.log_density(&candidates);
    let mut order: Vec<usize> = (0..CANDIDATES).filter(|&i| density[i].is_finite()).collect();
    if order.is_empty() {
        return Err(Stop::new("the posterior density is zero at every point tried in the prior")
            .help("check the priors and the units of the measurements"));
    }
    order.sort_by(|&a, &b| density[b].total_cmp(&density[a]).then(a.cmp(&b)));
    // Half of the starts are the best candidates, half are spread over the others.
    let (best, rest) = order.split_at((STARTS / 2).min(order.len()));
    let spread = rest.iter().step_by((rest.len() / (STARTS / 2)).max(1)).take(STARTS / 2);
    let chosen: Vec<usize> = best.iter().chain(spread).copied().collect();
    let maxima = optimise::maximise(&mode, &candidates.select_rows(&chosen));
    if maxima.is_empty() {
        return Err(Stop::new("no maximum of the posterior density was found"));
    }
    Ok(maxima)
}

/// The first points of a sequence at which the density is above zero: `more` gives the sequence piece by piece.
pub(super) fn inside(
    posterior: &Posterior<'_>,
    chains: usize,
    mut more: impl FnMut(usize) -> Result<Matrix, Stop>,
) -> Result<Matrix, Stop> {
    const PIECES: usize = 64;
    let (mut found, mut tried) = (Matrix::zeros(0, posterior.dimension()), 0);
    for piece in 0..PIECES {
        let points = more(piece)?;
        tried += points.rows();
        let density = posterior.log_density(&points);
        let finite = (0..points.rows()).filter(|&i| density[i].is_finite());
        for i in finite.take(chains - found.rows()).collect::<Vec<_>>() {
            found.push_row(points.row(i));
        }
        if found.rows() == chains {
            return Ok(found);
        }
    }
    Err(Stop::new(format!(
        "only {} of {tried} points of the prior have a posterior density above zero, fewer than the {chains} chains",
        found.rows(),
    ))
    .help("start the chains at the best fit: `start = \"map\"` in `[sampler]`"))
}

/// A Sobol' sequence through the quantiles of the priors: `count` points, after `from`.
pub(super) fn sobol(posterior: &Posterior<'_>, from: usize, count: usize) -> Result<Matrix, Stop> {
    let priors: Vec<&Distribution> = posterior.priors().collect();
    if priors.len() > sobol::LARGEST_DIMENSION {
        let most = sobol::LARGEST_DIMENSION;
        let message = format!("{} unknowns are too many for a Sobol' start", priors.len());
        return Err(Stop::new(message).help(format!("the most is {most}: use `start = \"prior\"`")));
    }
    let point = |i: usize| {
        let unit = sobol::point(i as u32, priors.len());
        let natural: Vec<f64> = priors.iter().zip(unit).map(|(p, u)| p.quantile(u)).collect();
        posterior.coordinates(&natural)
    };
    Ok(Matrix::from_rows(priors.len(), (from..from + count).map(point)))
}
