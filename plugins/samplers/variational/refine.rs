//! Normal approximation with the largest evidence lower bound, by natural gradients.
//!
//! The bound is the mean of the log density over fixed points `m + L z_i` plus the entropy (Giordano, Ingram and
//! Broderick 2024). Mean and precision follow Khan and Rue (2023, equations 10 and 11); the mean Hessian is that of
//! Stein's lemma, `L' E[H] L = E[z (L' g)']`. The nodes `z_i` have exactly zero mean and unit covariance, so that one
//! step reaches a normal target.

use lacuna::math::random::{Stream, normal};
use lacuna::math::special::HALF_LN_TWO_PI;
use lacuna::math::transform::Unconstrained;
use lacuna::plugin::Target;
use lacuna_linalg::{
    Cholesky, Matrix, multiply, multiply_transposed, solve_lower, symmetric_eigen,
    transposed_multiply, transposed_multiply_vector,
};
use rayon::prelude::*;

use super::Fit;
use super::law::Law;

/// Minimum gain of a step, in units of log density; the refinement ends below it. A density whose model is integrated
/// numerically has no more digits, and draws are corrected by their weights.
const LEAST_GAIN: f64 = 1e-3;
/// Maximum number of halvings of a step.
const HALVINGS: i32 = 12;
/// Maximum factor by which one step may increase a standard deviation.
const LARGEST_GROWTH: f64 = 3.0;

/// Outcome of one iteration.
pub(super) struct Refined {
    pub fit: Fit,
    /// True if further iterations may gain more.
    pub on: bool,
    pub evaluations: u64,
}

/// Returns the fixed nodes of a path, one per row: pairs of opposite normal draws, whitened.
pub(super) fn nodes(dimension: usize, path: usize) -> Matrix {
    let half = (5 * dimension).max(50);
    let mut rng = Stream::root(0).named("nodes").at(path as u64).generator();
    let draws = Matrix::from_fn(half, dimension, |_, _| normal(&mut rng));
    let mut covariance = transposed_multiply(&draws, &draws);
    for entry in covariance.as_mut_slice() {
        *entry /= half as f64;
    }
    let mut nodes = Matrix::zeros(0, dimension);
    let cholesky = Cholesky::new(&covariance).ok();
    for row in draws.iter_rows() {
        let mut z = row.to_vec();
        if let Some(cholesky) = &cholesky {
            solve_lower(cholesky.lower(), &mut z);
        }
        nodes.push_row(&z);
        nodes.extend_row(z.iter().map(|z| -z));
    }
    nodes
}

/// Returns the evidence lower bound on the nodes; minus infinity if the density is zero at one of them.
fn bound(law: &Law, values: &[f64]) -> f64 {
    let entropy = law.mean.len() as f64 * (0.5 + HALF_LN_TWO_PI) + law.log_volume();
    values.iter().sum::<f64>() / values.len() as f64 + entropy
}

/// Makes the longest step along the natural gradient (1, 1/2, 1/4, ...) that increases the bound.
pub(super) fn iterate(target: &Unconstrained<'_>, fit: Fit, nodes: &Matrix) -> Refined {
    let count = nodes.rows();
    let points = fit.law.points(nodes);
    let rows: Vec<&[f64]> = points.iter_rows().collect();
    let found: Vec<(f64, Vec<f64>)> = rows.par_iter().map(|u| target.gradient(u)).collect();
    // Values with and without derivatives come from different runs of a model that is integrated numerically, and differ by
    // its error: bounds are compared by values without.
    let present = bound(&fit.law, &target.log_density(&points));
    let mut evaluations = 2 * count as u64;
    if !present.is_finite() {
        // The density is zero at some node: a narrower distribution may avoid that.
        let law = fit.law.widened(0.5);
        let on = law.log_volume().is_finite();
        return Refined { fit: Fit { law, bound: fit.bound }, on, evaluations };
    }
    // Each row is `L' g`.
    let pulled = Matrix::from_rows(
        nodes.columns(),
        found.iter().map(|(_, g)| transposed_multiply_vector(&fit.law.factor, g)),
    );
    for halving in 0..HALVINGS {
        let Some(law) = moved(&fit.law, nodes, &pulled, 0.5_f64.powi(halving)) else { break };
        evaluations += count as u64;
        let reached = bound(&law, &target.log_density(&law.points(nodes)));
        if reached > present {
            let on = reached - present > LEAST_GAIN;
            return Refined { fit: Fit { law, bound: reached }, on, evaluations };
        }
    }
    Refined { fit: Fit { law: fit.law, bound: present }, on: false, evaluations }
}

/// Returns the distribution after a step of length `rate`; `None` if it is not a proper one.
fn moved(law: &Law, nodes: &Matrix, pulled: &Matrix, rate: f64) -> Option<Law> {
    let (count, d) = (nodes.rows() as f64, nodes.columns());
    let products = transposed_multiply(nodes, pulled);
    let precision = Matrix::from_fn(d, d, |i, j| {
        let second = 0.5 * (products[(i, j)] + products[(j, i)]) / count;
        (1.0 - rate) * f64::from(u8::from(i == j)) - rate * second
    });
    let eigen = symmetric_eigen(&precision).ok()?;
    let least = LARGEST_GROWTH.powi(-2);
    let spread =
        Matrix::from_fn(d, d, |i, k| eigen.vectors[(i, k)] / eigen.values[k].max(least).sqrt());
    let factor = multiply(&law.factor, &spread);
    let slope: Vec<f64> =
        (0..d).map(|j| rate * pulled.column(j).iter().sum::<f64>() / count).collect();
    let shift =
        lacuna_linalg::multiply_vector(&factor, &transposed_multiply_vector(&spread, &slope));
    let mean = law.mean.iter().zip(shift).map(|(m, s)| m + s).collect();
    Law::new(mean, &multiply_transposed(&factor, &factor))
}
