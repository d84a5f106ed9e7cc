//! Normal densities estimated from a sample.

use std::f64::consts::{PI, TAU};

use lacuna::math::special::ln_gamma;
use lacuna_linalg::{Cholesky, Matrix};

use super::Estimator;

/// Log of the estimated normal density at a point, from a sample with one row per draw; minus infinity if the estimate is
/// zero or the covariance of the sample is singular.
///
/// With the mean `m` and the sums of products `M` of `n` draws of dimension `d`, `q = (y - m)' M⁻¹ (y - m)`, the unbiased
/// estimate is (Ghurye and Olkin 1969; Price et al. 2018, equation 4)
///
/// ```text
/// π^(-d/2) (1 - 1/n)^(-d/2) Π_i Γ((n - i) / 2) / Γ((n - 1 - i) / 2) |M|^(-1/2) (1 - q n / (n - 1))^((n - d - 3) / 2)
/// ```
pub(super) fn log_density(point: &[f64], sample: &[Vec<f64>], estimator: Estimator) -> f64 {
    let (d, n) = (point.len(), sample.len() as f64);
    let mean: Vec<f64> = (0..d).map(|j| sample.iter().map(|row| row[j]).sum::<f64>() / n).collect();
    let mut products = Matrix::zeros(d, d);
    for row in sample {
        for i in 0..d {
            for j in 0..=i {
                products[(i, j)] += (row[i] - mean[i]) * (row[j] - mean[j]);
            }
        }
    }
    let Ok(factor) = Cholesky::new(&products) else { return f64::NEG_INFINITY };
    let gap: Vec<f64> = point.iter().zip(&mean).map(|(y, m)| y - m).collect();
    let square = factor.quadratic(&gap);
    let (size, determinant) = (d as f64, factor.log_determinant());
    match estimator {
        Estimator::PlugIn => {
            let scale = n - 1.0;
            -0.5 * (size * (TAU / scale).ln() + determinant + scale * square)
        }
        Estimator::Unbiased => {
            let inside = 1.0 - square * n / (n - 1.0);
            if inside <= 0.0 {
                return f64::NEG_INFINITY;
            }
            let ratio = |i: usize| {
                let i = i as f64;
                ln_gamma(0.5 * (n - i)) - ln_gamma(0.5 * (n - 1.0 - i))
            };
            let constant =
                (1..=d).map(ratio).sum::<f64>() - 0.5 * size * (PI * (1.0 - 1.0 / n)).ln();
            constant - 0.5 * determinant + 0.5 * (n - size - 3.0) * inside.ln()
        }
    }
}
