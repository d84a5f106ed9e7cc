//! Noise that the curves of one condition share: random effects of whole replicates, and correlated innovations.

use lacuna::math::special::gamma_tails;
use lacuna_linalg::{Cholesky, Matrix};

use super::curve::{Differences, ReplicateVariation};
use super::{CurveNoise, Noise, Origin};
use crate::gap::experiment::Experiment;

/// Correlations with a smaller probability than this under independence are taken as real.
const CLEAR: f64 = 0.01;

/// Estimates the shared noise for each condition, and subtracts the shared random effects from those of the curves.
pub(super) fn find(experiment: &Experiment<'_>, differences: &[Differences], noise: &mut Noise) {
    for (c, condition) in experiment.conditions.iter().enumerate() {
        let curves = condition.curves.clone();
        let of_replicates = |s: usize| noise.origins[s] == Origin::Replicates;
        if curves.len() < 2 || !curves.clone().all(of_replicates) {
            continue;
        }
        let own = &differences[curves.clone()];
        // Only differences between the same replicates are comparable across curves.
        if own.iter().any(|d| d.count() != own[0].count()) || own[0].count() < 3 {
            continue;
        }
        noise.shared[c] = wander(own, &mut noise.curves[curves.clone()]);
        noise.across[c] = across(own, &noise.curves[curves]);
    }
}

/// The variance of each random effect that all curves share, if it is above twice its standard error: the mean product
/// of the coefficients of two different curves.
fn wander(differences: &[Differences], curves: &mut [CurveNoise]) -> ReplicateVariation {
    let coefficients: Vec<Vec<[f64; 3]>> =
        differences.iter().zip(&*curves).map(|(d, noise)| d.coefficients(noise)).collect();
    let (count, pairs) = (coefficients[0].len(), (curves.len() * (curves.len() - 1)) as f64);
    let mut shared = [0.0; 3];
    for (k, shared) in shared.iter_mut().enumerate() {
        let products: Vec<f64> = (0..count)
            .map(|r| {
                let (sum, squares) = coefficients.iter().fold((0.0, 0.0), |(sum, squares), b| {
                    (sum + b[r][k], squares + b[r][k] * b[r][k])
                });
                (sum * sum - squares) / pairs
            })
            .collect();
        let mean = products.iter().sum::<f64>() / count as f64;
        let scatter = products.iter().map(|p| (p - mean).powi(2)).sum::<f64>();
        let error = (scatter / (count as f64 * (count as f64 - 1.0))).sqrt();
        if mean > 2.0 * error {
            *shared = mean;
        }
    }
    for noise in curves {
        let [offset, gain, clock] = noise.wander.variances();
        noise.wander = ReplicateVariation {
            offset: (offset - shared[0]).max(0.0),
            gain: (gain - shared[1]).max(0.0),
            clock: (clock - shared[2]).max(0.0),
        };
    }
    let [offset, gain, clock] = shared;
    ReplicateVariation { offset, gain, clock }
}

/// The factor of the correlation of innovations between curves, if Bartlett's test (Biometrika 38 (1951) 337) rejects
/// independence; the curves must have equally many values.
fn across(differences: &[Differences], curves: &[CurveNoise]) -> Option<Matrix> {
    let innovations: Vec<Vec<f64>> =
        differences.iter().zip(curves).map(|(d, noise)| d.innovations(noise)).collect();
    let (size, count) = (curves.len(), innovations[0].len());
    if innovations.iter().any(|own| own.len() != count) || count < 4 * size {
        return None;
    }
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let correlation = Matrix::from_fn(size, size, |i, j| {
        let product: f64 = innovations[i].iter().zip(&innovations[j]).map(|(x, y)| x * y).sum();
        if i == j { 1.0 } else { product / (norm(&innovations[i]) * norm(&innovations[j])) }
    });
    let factor = Cholesky::new(&correlation).ok()?;
    let freedom = (size * (size - 1)) as f64 / 2.0;
    let weight = count as f64 - 1.0 - (2.0 * size as f64 + 5.0) / 6.0;
    let statistic = -weight * factor.log_determinant();
    let (_, log_probability) = gamma_tails(0.5 * freedom, 0.5 * statistic.max(0.0));
    (log_probability.exp() < CLEAR).then(|| factor.lower().clone())
}
