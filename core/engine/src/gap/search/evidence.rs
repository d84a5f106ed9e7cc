//! The evidence (marginal likelihood) of the replicates' means under a system: Laplace's method, corrected by
//! importance sampling.

use lacuna::math::random::{Stream, normal};
use lacuna::math::special::ln_gamma;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply_vector};

use crate::gap::system::System;
use crate::gap::system::fit::Fit;
use crate::gap::system::whitener::Whitener;

/// Degrees of freedom of the proposal, whose tails are heavier than those of a posterior.
const FREEDOM: f64 = 6.0;

/// Largest number of draws from the proposal.
const DRAWS: usize = 400;

/// Number of draws between two checks of the standard error.
const BATCH: usize = 50;

/// Standard error of the log evidence at which no more draws are made: odds are compared with 20 to 1.
const ACCURATE: f64 = 0.07;

/// Smallest effective number of draws; below it Laplace's method is used.
const ENOUGH: f64 = 10.0;

/// The log density of a normal distribution falls by 0.5 over one standard deviation; if it falls by more than this,
/// the posterior is narrower than its curvature at the maximum suggests.
const STEEP: f64 = 2.0;

/// The largest number of times that the width of an unknown is halved.
const HALVINGS: usize = 12;

/// A log evidence (log marginal likelihood), up to the determinant of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogEvidence {
    /// The natural logarithm of the evidence, without the determinant of the noise.
    pub value: f64,
    /// The standard error of the importance sampling estimate; zero for Laplace's method.
    pub error: f64,
}

/// The log evidence of a system, by importance sampling with a multivariate t distribution around its best fit (Geweke,
/// Econometrica 57 (1989) 1317); by Laplace's method if the draws miss the posterior. `means` has one value per output,
/// in the response's unit.
pub fn log_evidence(
    system: &System<'_>,
    whitener: &Whitener,
    means: &[f64],
    fit: &Fit,
    stream: &Stream,
) -> LogEvidence {
    let laplace = LogEvidence { value: fit.log_evidence(), error: 0.0 };
    let precision = narrowed(system, whitener, means, fit);
    let d = precision.rows();
    let scale: Vec<f64> = (0..d).map(|j| 1.0 / precision[(j, j)].sqrt()).collect();
    let scaled = Matrix::from_fn(d, d, |i, j| precision[(i, j)] * scale[i] * scale[j]);
    let Ok(covariance) = Cholesky::new(&scaled).map(|factor| factor.inverse()) else {
        return laplace;
    };
    let Ok(factor) = Cholesky::new(&covariance) else { return laplace };
    let log_scale: f64 = scale.iter().map(|s| s.ln()).sum::<f64>() + 0.5 * factor.log_determinant();
    let draw = |b: usize| {
        let mut rng = stream.at(b as u64).generator();
        let z: Vec<f64> = (0..d).map(|_| normal(&mut rng)).collect();
        let chi: f64 = (0..FREEDOM as usize).map(|_| normal(&mut rng).powi(2)).sum();
        let stretch = (FREEDOM / chi).sqrt();
        let shift = multiply_vector(factor.lower(), &z);
        let point: Vec<f64> =
            (0..d).map(|j| fit.at.point[j] + scale[j] * stretch * shift[j]).collect();
        (point, log_density_of_t(stretch * stretch * dot(&z, &z), d) - log_scale)
    };
    let mut weights: Vec<f64> = Vec::new();
    while weights.len() < DRAWS {
        let batch = weights.len()..weights.len() + BATCH;
        let (points, proposals): (Vec<Vec<f64>>, Vec<f64>) = batch.map(draw).unzip();
        let densities = log_densities(system, whitener, means, &points);
        weights.extend(densities.iter().zip(&proposals).map(|(p, q)| p - q));
        // Laplace's method is exact to this accuracy for most systems: a few draws confirm it.
        if let Some(found) = summary(&weights).filter(|found| found.error < ACCURATE) {
            return found;
        }
    }
    summary(&weights).unwrap_or(laplace)
}

/// The precision of a fit, increased for unknowns along which the density falls faster than its curvature at the best
/// point suggests: the density of a time between two samples, for example, is flat there and falls steeply at both
/// samples.
fn narrowed(system: &System<'_>, whitener: &Whitener, means: &[f64], fit: &Fit) -> Matrix {
    let mut precision = fit.precision_of_evidence();
    let (point, bounds) = (&fit.at.point, system.bounds());
    let mut steep: Vec<usize> = (0..point.len()).collect();
    for _ in 0..HALVINGS {
        let mut moved = Vec::new();
        for &j in &steep {
            let sd = 1.0 / precision[(j, j)].sqrt();
            for sign in [-1.0, 1.0] {
                let mut other = point.clone();
                other[j] = (point[j] + sign * sd).clamp(bounds[j].0, bounds[j].1);
                moved.push(other);
            }
        }
        let densities = log_densities(system, whitener, means, &moved);
        let best = fit.log_prior + fit.noise_scale.log_density(dot(&fit.residual, &fit.residual));
        let falls = |k: usize| densities[2 * k..2 * k + 2].iter().any(|x| *x < best - STEEP);
        steep = (0..steep.len()).filter(|&k| falls(k)).map(|k| steep[k]).collect();
        if steep.is_empty() {
            break;
        }
        for &j in &steep {
            precision[(j, j)] *= 4.0;
        }
    }
    precision
}

/// The log density of the multivariate t law of unit scale at a squared distance.
fn log_density_of_t(square: f64, d: usize) -> f64 {
    let d = d as f64;
    ln_gamma(0.5 * (FREEDOM + d))
        - ln_gamma(0.5 * FREEDOM)
        - 0.5 * d * (FREEDOM * std::f64::consts::PI).ln()
        - 0.5 * (FREEDOM + d) * (square / FREEDOM).ln_1p()
}

/// The log posterior densities at points, up to a constant that depends on the noise only; minus infinity out of
/// bounds.
fn log_densities(
    system: &System<'_>,
    whitener: &Whitener,
    means: &[f64],
    points: &[Vec<f64>],
) -> Vec<f64> {
    let bounds = system.bounds();
    let inside = |p: &Vec<f64>| p.iter().zip(&bounds).all(|(x, (lo, hi))| lo <= x && x <= hi);
    let used: Vec<usize> = (0..points.len()).filter(|&b| inside(&points[b])).collect();
    let chosen: Vec<&[f64]> = used.iter().map(|&b| &points[b][..]).collect();
    let mut densities = vec![f64::NEG_INFINITY; points.len()];
    if used.is_empty() {
        return densities;
    }
    let misfits = system
        .responses(&chosen)
        .into_iter()
        .map(|response| -> Vec<f64> { means.iter().zip(response).map(|(y, m)| y - m).collect() });
    let white = whitener.whiten_rows(&Matrix::from_rows(means.len(), misfits));
    for (&b, z) in used.iter().zip(white.iter_rows()) {
        let density = system.log_prior(&points[b]) + whitener.noise_scale.log_density(dot(z, z));
        densities[b] = if density.is_nan() { f64::NEG_INFINITY } else { density };
    }
    densities
}

fn summary(weights: &[f64]) -> Option<LogEvidence> {
    let largest = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return None;
    }
    let relative: Vec<f64> = weights.iter().map(|w| (w - largest).exp()).collect();
    let (sum, squares) = (relative.iter().sum::<f64>(), dot(&relative, &relative));
    let effective = sum * sum / squares;
    let n = weights.len() as f64;
    let error = (1.0 / effective - 1.0 / n).max(0.0).sqrt();
    (effective >= ENOUGH).then(|| LogEvidence { value: largest + (sum / n).ln(), error })
}
