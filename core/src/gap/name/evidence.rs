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
const ENOUGH: f64 = 30.0;

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
    let precision = fit.precision();
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
    let weights = log_weights(system, whitener, means, &points, &proposals);
    summary(&weights).unwrap_or(laplace)
}

/// The log density of the multivariate t law of unit scale at a squared distance.
fn log_density_of_t(square: f64, d: usize) -> f64 {
    let d = d as f64;
    ln_gamma(0.5 * (FREEDOM + d))
        - ln_gamma(0.5 * FREEDOM)
        - 0.5 * d * (FREEDOM * std::f64::consts::PI).ln()
        - 0.5 * (FREEDOM + d) * (square / FREEDOM).ln_1p()
}

fn log_weights(
    system: &System<'_>,
    whitener: &Whitener,
    means: &[f64],
    points: &[Vec<f64>],
    proposals: &[f64],
) -> Vec<f64> {
    let bounds = system.bounds();
    let inside = |p: &Vec<f64>| p.iter().zip(&bounds).all(|(x, (lo, hi))| lo <= x && x <= hi);
    let used: Vec<usize> = (0..points.len()).filter(|&b| inside(&points[b])).collect();
    let chosen: Vec<&[f64]> = used.iter().map(|&b| &points[b][..]).collect();
    let mut weights = vec![f64::NEG_INFINITY; points.len()];
    if used.is_empty() {
        return weights;
    }
    let misfits = system
        .responses(&chosen)
        .into_iter()
        .map(|response| -> Vec<f64> { means.iter().zip(response).map(|(y, m)| y - m).collect() });
    let white = whitener.whiten_rows(&Matrix::from_rows(means.len(), misfits));
    for (&b, z) in used.iter().zip(white.iter_rows()) {
        let density = system.log_prior(&points[b]) - 0.5 * dot(z, z);
        weights[b] = if density.is_nan() { f64::NEG_INFINITY } else { density - proposals[b] };
    }
    weights
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
