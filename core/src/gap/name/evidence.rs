//! The probability of the means under a system: Laplace's method, made exact by importance sampling.

use crate::gap::fit::Fit;
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::linalg::vector::dot;
use crate::linalg::{Cholesky, Matrix, multiply_vector};
use crate::math::random::{Stream, normal};
use crate::math::special::ln_gamma;

/// Degrees of freedom of the proposal: heavier tails than a posterior's.
const FREEDOM: f64 = 6.0;

/// Draws from the proposal.
const DRAWS: usize = 400;

/// Fewer effective draws say less than Laplace's method.
const ENOUGH: f64 = 10.0;

/// The log density falls by a half over one standard deviation of a normal law; where it falls by more than this, the law is
/// narrower than its curvature at the best point says.
const STEEP: f64 = 2.0;

/// Times that the width of an unknown is halved at most.
const HALVINGS: usize = 12;

/// An evidence, less what the noise alone decides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weighed {
    /// Its logarithm.
    pub log_evidence: f64,
    /// The standard error of that; zero by Laplace's method.
    pub error: f64,
}

/// The evidence of a system around its best fit, by draws from a multivariate t law there (Geweke, Econometrica 57
/// (1989) 1317); that of Laplace where the draws miss the posterior.
pub fn weigh(
    system: &System<'_>,
    whitener: &Whitener,
    means: &[f64],
    fit: &Fit,
    stream: &Stream,
) -> Weighed {
    let laplace = Weighed { log_evidence: fit.log_evidence(), error: 0.0 };
    let precision = narrowed(system, whitener, means, fit);
    let d = precision.rows();
    let scale: Vec<f64> = (0..d).map(|j| 1.0 / precision[(j, j)].sqrt()).collect();
    let scaled = Matrix::from_fn(d, d, |i, j| precision[(i, j)] * scale[i] * scale[j]);
    let Ok(covariance) = Cholesky::new(&scaled).map(|factor| factor.inverse()) else {
        return laplace;
    };
    let Ok(factor) = Cholesky::new(&covariance) else { return laplace };
    let log_scale: f64 = scale.iter().map(|s| s.ln()).sum::<f64>() + 0.5 * factor.log_determinant();
    let mut points = Vec::new();
    let mut proposals = Vec::new();
    for b in 0..DRAWS {
        let mut rng = stream.at(b as u64).generator();
        let z: Vec<f64> = (0..d).map(|_| normal(&mut rng)).collect();
        let chi: f64 = (0..FREEDOM as usize).map(|_| normal(&mut rng).powi(2)).sum();
        let stretch = (FREEDOM / chi).sqrt();
        let shift = multiply_vector(factor.lower(), &z);
        let point: Vec<f64> =
            (0..d).map(|j| fit.at.point[j] + scale[j] * stretch * shift[j]).collect();
        points.push(point);
        proposals.push(log_density_of_t(stretch * stretch * dot(&z, &z), d) - log_scale);
    }
    let densities = log_densities(system, whitener, means, &points);
    let weights: Vec<f64> = densities.iter().zip(&proposals).map(|(p, q)| p - q).collect();
    summary(&weights).unwrap_or(laplace)
}

/// The precision of a fit, larger for unknowns along which the density falls faster than the curvature at the best point says: a
/// time between two samples, say, is flat there and has walls.
fn narrowed(system: &System<'_>, whitener: &Whitener, means: &[f64], fit: &Fit) -> Matrix {
    let mut precision = fit.precision();
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
        let falls =
            |k: usize| densities[2 * k..2 * k + 2].iter().any(|x| *x < fit.log_density - STEEP);
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

/// The log posterior densities at points, up to what the noise alone decides; minus infinity out of bounds.
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
        let density = system.log_prior(&points[b]) - 0.5 * dot(z, z);
        densities[b] = if density.is_nan() { f64::NEG_INFINITY } else { density };
    }
    densities
}

fn summary(weights: &[f64]) -> Option<Weighed> {
    let largest = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return None;
    }
    let relative: Vec<f64> = weights.iter().map(|w| (w - largest).exp()).collect();
    let (sum, squares) = (relative.iter().sum::<f64>(), dot(&relative, &relative));
    let effective = sum * sum / squares;
    let n = weights.len() as f64;
    let error = (1.0 / effective - 1.0 / n).max(0.0).sqrt();
    (effective >= ENOUGH).then(|| Weighed { log_evidence: largest + (sum / n).ln(), error })
}
