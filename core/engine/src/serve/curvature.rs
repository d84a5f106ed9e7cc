//! Second derivatives as finite differences of exact first derivatives.

use lacuna::plugin::model::EvalError;
use lacuna_linalg::transposed_multiply_vector;

use super::Derivatives;

/// Derivative along `direction` of the gradient of `weights · values`, by finite differences of the exact gradient with
/// a relative error of about 1e-10; `None` if the function is not smooth enough.
///
/// Central differences with the cube root of the machine precision as step, relative to the scale of each variable,
/// which balances round-off and truncation (Nocedal and Wright, Numerical Optimization, 2nd edition, section 8.1); if
/// one side cannot be evaluated, three points on the other side are used.
pub fn curvature(
    function: &dyn Derivatives,
    point: &[f64],
    scenario: Option<usize>,
    weights: &[f64],
    direction: &[f64],
) -> Option<Result<Vec<f64>, EvalError>> {
    let scales = function.scales()?;
    let size = |i: usize| {
        let scale = scales[i];
        if scale > 0.0 && scale.is_finite() { scale } else { point[i].abs().max(1.0) }
    };
    let longest = (0..point.len()).map(|i| (direction[i] / size(i)).abs()).fold(0.0, f64::max);
    if longest == 0.0 {
        return Some(Ok(vec![0.0; point.len()]));
    }
    let step = f64::EPSILON.cbrt() / longest;
    let gradient = |steps: f64| {
        let moved: Vec<f64> =
            point.iter().zip(direction).map(|(x, v)| x + steps * step * v).collect();
        let jacobian = function.jacobian(&moved, scenario)?;
        Ok(transposed_multiply_vector(&jacobian, weights))
    };
    Some(differences(gradient, step))
}

fn differences(
    gradient: impl Fn(f64) -> Result<Vec<f64>, EvalError>,
    step: f64,
) -> Result<Vec<f64>, EvalError> {
    let sum = |parts: &[(f64, Vec<f64>)]| {
        let of = |i: usize| parts.iter().map(|(c, g)| c * g[i]).sum::<f64>() / step;
        (0..parts[0].1.len()).map(of).collect()
    };
    match (gradient(-1.0), gradient(1.0)) {
        (Ok(before), Ok(after)) => Ok(sum(&[(-0.5, before), (0.5, after)])),
        (Err(_), Ok(after)) => {
            Ok(sum(&[(-1.5, gradient(0.0)?), (2.0, after), (-0.5, gradient(2.0)?)]))
        }
        (Ok(before), Err(_)) => {
            Ok(sum(&[(1.5, gradient(0.0)?), (-2.0, before), (0.5, gradient(-2.0)?)]))
        }
        (Err(error), Err(_)) => Err(error),
    }
}
