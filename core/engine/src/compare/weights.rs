//! Weights of several studies in one prediction.
//!
//! *Stacking* (Yao, Vehtari, Simpson and Gelman, Bayesian Analysis 13 (2018) 917) maximises the log density that the
//! mixture of the studies gives to left-out data, `mean_i log sum_k w_k p_ik`: none of the studies need be true. *Pseudo-BMA+*
//! there weights each study by its own left-out predictions, `exp(elpd)`, averaged over Bayesian bootstrap samples of the
//! data, which contains the uncertainty of `elpd`.

use lacuna::diagnose::leave_one_out::LeaveOneOut;
use lacuna::math::moments::log_sum;
use lacuna::math::random::{Stream, uniform};
use lacuna_linalg::Matrix;

/// Largest number of steps towards the stacking weights.
const STEPS: usize = 100_000;
/// Number of bootstrap samples.
const SAMPLES: u64 = 4000;

/// Returns the log density of each left-out part under each study, `parts x studies`; `None` if the studies have other
/// parts, fewer than two, or a sample of them, whose sums are not those of all.
pub(super) fn densities(left_out: &[&LeaveOneOut]) -> Option<Matrix> {
    let parts = left_out.first()?.data.len();
    if left_out.iter().any(|one| one.sampled.is_some()) {
        return None;
    }
    if parts < 2 || left_out.len() < 2 || left_out.iter().any(|one| one.data.len() != parts) {
        return None;
    }
    Some(Matrix::from_fn(parts, left_out.len(), |i, k| left_out[k].data[i].elpd))
}

/// Returns the stacking weights, given log densities `parts x studies`.
///
/// The objective is concave. Each step multiplies a weight by the mean share of its study in the density of the mixture (the
/// EM algorithm for known components), which never lowers the objective.
pub(super) fn stacking(densities: &Matrix) -> Vec<f64> {
    let (parts, studies) = (densities.rows(), densities.columns());
    let scaled = Matrix::from_rows(studies, densities.iter_rows().map(relative));
    let mut weights = vec![1.0 / studies as f64; studies];
    for _ in 0..STEPS {
        let mut next = vec![0.0; studies];
        for row in scaled.iter_rows() {
            let total: f64 = row.iter().zip(&weights).map(|(p, w)| p * w).sum();
            for ((sum, p), w) in next.iter_mut().zip(row).zip(&weights) {
                *sum += w * p / total / parts as f64;
            }
        }
        let moved = next.iter().zip(&weights).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        weights = next;
        if moved < 1e-10 {
            break;
        }
    }
    weights
}

/// Returns densities relative to the largest.
fn relative(logs: &[f64]) -> Vec<f64> {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    logs.iter().map(|log| (log - most).exp()).collect()
}

/// Returns the weights of pseudo-BMA+, given log densities `parts x studies`.
pub(super) fn pseudo_bma(densities: &Matrix) -> Vec<f64> {
    let (parts, studies) = (densities.rows(), densities.columns());
    let stream = Stream::root(0).named("pseudo-bma");
    let mut weights = vec![0.0; studies];
    for sample in 0..SAMPLES {
        let mut rng = stream.at(sample).generator();
        // Uniform shares of the data: normalised exponential numbers.
        let shares: Vec<f64> = (0..parts).map(|_| -(-uniform(&mut rng)).ln_1p()).collect();
        let total: f64 = shares.iter().sum();
        let mut sums = vec![0.0; studies];
        for (row, share) in densities.iter_rows().zip(&shares) {
            let scale = parts as f64 * share / total;
            sums.iter_mut().zip(row).for_each(|(sum, log)| *sum += scale * log);
        }
        let all = log_sum(sums.iter().copied());
        let each = weights.iter_mut().zip(&sums);
        each.for_each(|(weight, sum)| *weight += (sum - all).exp() / SAMPLES as f64);
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two data favour the first study with densities `a` and `b`, one the second: `2 log(w a + (1 - w) b) + log(w b +
    /// (1 - w) a)` is largest at `w = (2 a - b) / (3 (a - b))`.
    #[test]
    fn stacking_has_its_closed_form() {
        let (a, b) = (0.9_f64, 0.2_f64);
        let rows = [[a.ln(), b.ln()], [a.ln(), b.ln()], [b.ln(), a.ln()]];
        let weights = stacking(&Matrix::from_rows(2, rows));
        let expected = (2.0 * a - b) / (3.0 * (a - b));
        assert!((weights[0] - expected).abs() < 1e-8, "{} {expected}", weights[0]);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    const STACKING: [f64; 3] = [0.458_09, 0.398_12, 0.143_79];
    /// Mean over five seeds.
    const PSEUDO_BMA: [f64; 3] = [0.3989, 0.3718, 0.2294];
    const DENSITIES: [[f64; 3]; 8] = [
        [-1.10, -0.60, -2.00],
        [-0.90, -1.80, -1.10],
        [-1.40, -1.35, -0.40],
        [-0.70, -1.00, -1.90],
        [-2.10, -0.80, -1.00],
        [-0.80, -1.20, -1.30],
        [-1.00, -1.70, -0.90],
        [-1.30, -0.90, -1.60],
    ];

    /// Weights of the same densities by ArviZ 0.23.4, `compare` with the methods `stacking` and `BB-pseudo-BMA`; the
    /// second with 1000 random samples for each of five seeds: the standard deviations of the bootstrap weights are about
    /// 0.2, so that the difference to our 4000 samples has a standard error of 0.005.
    #[test]
    fn weights_agree_with_arviz() {
        let densities = Matrix::from_rows(3, DENSITIES);
        for (found, expected) in stacking(&densities).iter().zip(STACKING) {
            assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        }
        for (found, expected) in pseudo_bma(&densities).iter().zip(PSEUDO_BMA) {
            assert!((found - expected).abs() < 0.02, "{found} {expected}");
        }
    }
}
