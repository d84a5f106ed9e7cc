//! The posterior of the weights of a force in a linearised problem.

use lacuna_linalg::{Matrix, multiply_vector, symmetric_eigen, transposed_multiply_vector};

/// The number of sizes that are tried, from a thousandth to a hundred times a unit.
const SIZES: usize = 31;

/// The linearised problem at a point, whitened.
pub(super) struct Linear {
    /// The residual to which the force that is there is added back, and the slopes of the unknowns, `unknowns x
    /// outputs`.
    pub residual: Vec<f64>,
    pub slopes: Matrix,
    /// The responses to all weights, `weights x outputs`, and their products in the metric.
    pub directions: Matrix,
    pub information: Matrix,
    pub score: Vec<f64>,
}

/// The posterior of the weights.
pub(super) struct Posterior {
    pub mean: Vec<f64>,
    pub root: Matrix,
    pub variances: Vec<f64>,
    pub log_evidence: f64,
}

/// The posterior with these widths of the prior at size one and the size of largest evidence, around `unit`.
pub(super) fn with_widths(linear: &Linear, width: &[f64], unit: f64) -> Option<Posterior> {
    let n = width.len();
    let scaled = Matrix::from_fn(n, n, |i, j| width[i] * linear.information[(i, j)] * width[j]);
    let eigen = symmetric_eigen(&scaled).ok()?;
    let score: Vec<f64> = linear.score.iter().zip(width).map(|(b, w)| b * w).collect();
    let along = transposed_multiply_vector(&eigen.vectors, &score);
    let evidence = |square: f64| -> f64 {
        let each = eigen.values.iter().zip(&along).map(|(l, b)| {
            let grown = square * l.max(0.0);
            0.5 * (square * b * b / (1.0 + grown) - grown.ln_1p())
        });
        each.sum()
    };
    let sizes = (0..SIZES).map(|k| {
        let size = unit * 10f64.powf(-3.0 + 5.0 * k as f64 / (SIZES - 1) as f64);
        (size * size, evidence(size * size))
    });
    let best = sizes.fold(None, |best: Option<(f64, f64)>, next| match best {
        Some(best) if best.1 >= next.1 => Some(best),
        _ => Some(next),
    });
    let (square, log_evidence) = best?;
    let spread: Vec<f64> =
        eigen.values.iter().map(|l| square / (1.0 + square * l.max(0.0))).collect();
    let inner: Vec<f64> = spread.iter().zip(&along).map(|(s, b)| s * b).collect();
    let mean = multiply_vector(&eigen.vectors, &inner);
    let mean = mean.iter().zip(width).map(|(m, w)| m * w).collect();
    let root =
        Matrix::from_fn(n, n, |i, a| width[i] * eigen.vectors[(i, a)] * spread[a].max(0.0).sqrt());
    let variances = width.iter().map(|w| square * w * w).collect();
    Some(Posterior { mean, root, variances, log_evidence })
}
