//! Starting points of the search for the MAP and of the chains.

use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::math::sobol;
use lacuna::math::special::ln_gamma;
use lacuna::plugin::Target;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::posterior::Posterior;

/// Number of prior draws among which the starting points of the optimiser are chosen.
const CANDIDATES: usize = 1000;
/// Number of the best candidates that are starting points regardless of their distances.
const BEST: usize = 4;
/// Largest number of starting points of the optimiser.
const STARTS: usize = 16;

/// Local maxima of the posterior density in natural units, best first. The search begins at draws of the prior, and at
/// the values that the study states for its parameters (`[[start]]`), the others being at the median of their priors.
pub(super) fn maxima(
    posterior: &Posterior<'_>,
    stated: &[Option<f64>],
    stream: &Stream,
) -> Result<Vec<lacuna_optimise::Optimum>, Stop> {
    let mode = posterior.mode();
    let d = posterior.parameters().len();
    let mut candidates = posterior.prior_draws(CANDIDATES, stream);
    let is_stated = stated.iter().any(Option::is_some);
    if is_stated {
        let middle = posterior.parameters().iter().map(|p| p.prior.quantile(0.5));
        let point = middle.zip(stated).map(|(x, own)| own.unwrap_or(x));
        let hyper = posterior.hyperparameters().iter().map(|h| h.start);
        let point = &posterior.coordinates(&point.chain(hyper).collect::<Vec<f64>>())[..d];
        candidates.push_row(&[point, &candidates.row(0)[d..]].concat());
    }
    // A discrepancy supplies a sensible starting value for its own unknowns; a wide prior of a variance does not.
    let starts: Vec<f64> = posterior.hyperparameters().iter().map(|h| h.start).collect();
    let filled = [vec![1.0; d], starts].concat();
    let hyper = posterior.coordinates(&filled)[d..].to_vec();
    for i in 0..candidates.rows() {
        candidates.row_mut(i)[d..].copy_from_slice(&hyper);
    }
    let density = mode.log_density(&candidates);
    if density.iter().all(|value| !value.is_finite()) {
        return Err(Stop::new("the posterior density is zero at every point tried in the prior")
            .help("check the priors and the units of the measurements"));
    }
    let mut chosen = peaks(&candidates, d, &density);
    if is_stated && !chosen.contains(&CANDIDATES) {
        chosen.push(CANDIDATES);
    }
    let maxima = lacuna_optimise::maximise(&mode, &candidates.select_rows(&chosen));
    if maxima.is_empty() {
        return Err(Stop::new("no maximum of the posterior density was found"));
    }
    Ok(maxima)
}

/// Indices of the best candidates, and of those that have no better one near them, the best first: the starting points
/// of multi-level single linkage (Rinnooy Kan and Timmer, Mathematical Programming 39 (1987) 57), which include one in
/// each basin of sufficient size.
///
/// Candidates are near each other within the critical distance of that method for points uniformly distributed in the
/// unit cube, as their ranks in the first `d` coordinates are: `(Gamma(1 + d / 2) 4 ln(n) / n)^(1 / d) / sqrt(pi)`.
fn peaks(candidates: &Matrix, d: usize, density: &[f64]) -> Vec<usize> {
    let n = candidates.rows();
    let mut order: Vec<usize> = (0..n).filter(|&i| density[i].is_finite()).collect();
    // Ties are ordered by index, so that the result does not depend on the sorting algorithm.
    order.sort_by(|&a, &b| density[b].total_cmp(&density[a]).then(a.cmp(&b)));
    let ranks: Vec<Vec<f64>> = (0..d).map(|j| shares(&candidates.column(j))).collect();
    let (n, half) = (n as f64, 0.5 * d as f64);
    let volume = ln_gamma(1.0 + half) + (4.0 * n.ln() / n).ln();
    let near = (volume / d as f64).exp() / std::f64::consts::PI.sqrt();
    let distance = |a: usize, b: usize| ranks.iter().map(|u| (u[a] - u[b]).powi(2)).sum::<f64>();
    let is_peak = |place: usize| {
        order[..place].iter().all(|&better| distance(better, order[place]) > near * near)
    };
    (0..order.len()).filter(|&p| p < BEST || is_peak(p)).take(STARTS).map(|p| order[p]).collect()
}

/// For each value, the fraction of the values below it.
fn shares(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut shares = vec![0.0; values.len()];
    for (rank, &i) in order.iter().enumerate() {
        shares[i] = (rank as f64 + 0.5) / values.len() as f64;
    }
    shares
}

/// The first points of a sequence with nonzero density; `more` returns the sequence piece by piece.
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

/// A Sobol' sequence mapped by the quantiles of the priors: `count` points, after the first `from`.
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

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::random::uniform;

    /// Each of two cones gets a start, although the second is lower and occupies a twentieth of the cube; candidates of
    /// zero density do not.
    #[test]
    fn every_basin_of_some_size_has_a_start() {
        for d in [2, 4, 6] {
            let mut rng = Stream::root(d as u64).generator();
            let points = Matrix::from_fn(CANDIDATES, d, |_, _| uniform(&mut rng));
            let second = 0.05_f64.powf(1.0 / d as f64);
            let from = |x: &[f64], at: f64| x.iter().map(|x| (x - at).powi(2)).sum::<f64>().sqrt();
            let is_second = |x: &[f64]| x.iter().all(|x| *x < second);
            let density = |x: &[f64]| match is_second(x) {
                true => -0.1 - from(x, 0.5 * second),
                false if x[0] > 0.98 => f64::NEG_INFINITY,
                false => -2.0 * from(x, 0.7),
            };
            let density: Vec<f64> = points.iter_rows().map(density).collect();
            let chosen = peaks(&points, d, &density);
            assert!(chosen.len() <= STARTS && chosen.iter().all(|&i| density[i].is_finite()));
            let best = density.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert_eq!(density[chosen[0]].to_bits(), best.to_bits());
            assert!(chosen.iter().any(|&i| is_second(points.row(i))), "{d}: {chosen:?}");
        }
    }
}
