//! Directions of the inputs by nonlinear partial least squares.
//!
//! The first direction is the covariance of the inputs with the output. Along it the output is fitted by a polynomial
//! `v(t)`, and the direction is refined by steps down the gradient of the squared residuals `y - v(w' x)`, as long as
//! they help. What the direction explains is then taken out of inputs and output, and the next one is sought in the
//! rest (Wold, Kettaneh-Wold and Skagerberg 1989; Papaioannou, Ehre and Straub 2019, algorithm 1).

use lacuna_linalg::vector::{add_scaled, dot, norm};
use lacuna_linalg::{Matrix, multiply_vector, transposed_multiply_vector};

use super::curve::Curve;

/// Size of a covariance relative to the largest possible one below which it is a rounding error.
const NOTHING: f64 = 1e-10;
/// Relative decrease of the error along a direction below which its refinement ends.
const GAIN: f64 = 0.01;

/// Finds up to `most` orthonormal directions (`inputs x directions`) of the inputs (`runs x inputs`, scaled to unit
/// variance) for one output. The first `m` columns are the directions that a search for `m` finds.
pub(super) fn directions(inputs: &Matrix, output: &[f64], most: usize, steps: usize) -> Matrix {
    let mut rest = centred(inputs);
    let mean = output.iter().sum::<f64>() / output.len() as f64;
    let mut residual: Vec<f64> = output.iter().map(|y| y - mean).collect();
    let size = norm(rest.as_slice());
    let mut found: Vec<Vec<f64>> = Vec::new();
    let mut deflation: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    while found.len() < most.min(inputs.columns()) {
        let Some((weights, curve)) = direction(&rest, &residual, size, steps) else { break };
        let scores = multiply_vector(&rest, &weights);
        let squares = dot(&scores, &scores);
        let loadings: Vec<f64> =
            transposed_multiply_vector(&rest, &scores).iter().map(|x| x / squares).collect();
        let Some(next) = orthonormal(&original(&weights, &deflation), &found) else { break };
        found.push(next);
        for (i, &t) in scores.iter().enumerate() {
            add_scaled(rest.row_mut(i), -t, &loadings);
            residual[i] -= curve.value(t);
        }
        deflation.push((weights, loadings));
    }
    Matrix::from_fn(inputs.columns(), found.len(), |i, j| found[j][i])
}

fn centred(inputs: &Matrix) -> Matrix {
    let runs = inputs.rows() as f64;
    let means: Vec<f64> =
        (0..inputs.columns()).map(|j| inputs.column(j).iter().sum::<f64>() / runs).collect();
    Matrix::from_fn(inputs.rows(), inputs.columns(), |i, j| inputs[(i, j)] - means[j])
}

/// Returns one direction of unit length and the polynomial along it; `None` if inputs and output do not covary.
fn direction(
    rest: &Matrix,
    residual: &[f64],
    size: f64,
    steps: usize,
) -> Option<(Vec<f64>, Curve)> {
    let covariance = transposed_multiply_vector(rest, residual);
    let mut weights = unit(&covariance, NOTHING * size * norm(residual))?;
    let mut curve = Curve::fit(&multiply_vector(rest, &weights), residual)?;
    for _ in 0..steps {
        let Some(tried) = refined(rest, residual, &weights, &curve) else { break };
        let Some(along) = Curve::fit(&multiply_vector(rest, &tried), residual) else { break };
        if along.error > (1.0 - GAIN) * curve.error {
            break;
        }
        (weights, curve) = (tried, along);
    }
    Some((weights, curve))
}

/// Steps down the gradient of the squared residuals, as far as is best if the polynomial is replaced by its tangents.
fn refined(rest: &Matrix, residual: &[f64], weights: &[f64], curve: &Curve) -> Option<Vec<f64>> {
    let scores = multiply_vector(rest, weights);
    let slopes: Vec<f64> = scores.iter().map(|&t| curve.slope(t)).collect();
    let left: Vec<f64> = residual.iter().zip(&scores).map(|(y, &t)| y - curve.value(t)).collect();
    let pull: Vec<f64> = left.iter().zip(&slopes).map(|(e, s)| e * s).collect();
    let gradient = transposed_multiply_vector(rest, &pull);
    let change: Vec<f64> =
        multiply_vector(rest, &gradient).iter().zip(&slopes).map(|(x, s)| x * s).collect();
    let length = dot(&gradient, &gradient) / dot(&change, &change);
    let mut next = weights.to_vec();
    add_scaled(&mut next, length, &gradient);
    if length.is_finite() { unit(&next, 0.0) } else { None }
}

/// Returns the direction in the original inputs of weights on the deflated ones: each earlier deflation
/// `E - E w p'` turns `E v` into `E (v - w p' v)`.
fn original(weights: &[f64], deflation: &[(Vec<f64>, Vec<f64>)]) -> Vec<f64> {
    let mut direction = weights.to_vec();
    for (earlier, loadings) in deflation.iter().rev() {
        let share = dot(loadings, &direction);
        add_scaled(&mut direction, -share, earlier);
    }
    direction
}

/// Returns the part of a direction that is orthogonal to the others, with unit length; `None` if nothing is left.
fn orthonormal(direction: &[f64], others: &[Vec<f64>]) -> Option<Vec<f64>> {
    let mut rest = direction.to_vec();
    // Twice, so that rounding errors of the first pass are removed too (Giraud, Langou and Rozložník 2005).
    for other in others.iter().chain(others) {
        let share = dot(other, &rest);
        add_scaled(&mut rest, -share, other);
    }
    unit(&rest, NOTHING * norm(direction))
}

/// Scales a vector to unit length; `None` if it is not longer than `least`.
fn unit(vector: &[f64], least: f64) -> Option<Vec<f64>> {
    let length = norm(vector);
    (length > least && length.is_finite()).then(|| vector.iter().map(|x| x / length).collect())
}
