//! Derivatives of effects by finite differences, for effects without a formula.

use lacuna_base::data::Layout;
use lacuna_base::matrix::Matrix;

use super::Effect;
use crate::plugin::Hyperparameter;

/// Share of a prior's width for steps in a formula.
pub const SMOOTH: f64 = 1e-4;

/// Share of a prior's width for steps in a simulation, whose response to a tiny change is decided by events such as
/// cavities that open one step earlier.
pub const SIMULATED: f64 = 0.02;

/// Finite differences for [`Effect::by_parameters`].
pub fn by_parameter_steps<E: Effect + ?Sized>(
    effect: &E,
    layout: &Layout,
    response: &[f64],
    values: &[f64],
) -> Matrix {
    let at = |values: &[f64]| effect.apply(layout, response, values);
    by_parameter_steps_of(&effect.parameters(layout), layout.len(), values, SMOOTH, at)
}

/// Derivatives of a function of these parameters by finite differences inside the priors' supports, `outputs x
/// parameters`. A step is this share of the central 95 % of a prior: [`SMOOTH`] for a formula, [`SIMULATED`] for a
/// simulation.
pub fn by_parameter_steps_of(
    parameters: &[Hyperparameter],
    outputs: usize,
    values: &[f64],
    share: f64,
    of: impl Fn(&[f64]) -> Vec<f64>,
) -> Matrix {
    let mut jacobian = Matrix::zeros(outputs, values.len());
    for (j, parameter) in parameters.iter().enumerate() {
        let at = |x: f64| {
            let mut moved = values.to_vec();
            moved[j] = x;
            of(&moved)
        };
        let prior = &parameter.prior;
        let width = prior.quantile(0.975) - prior.quantile(0.025);
        let slopes = slope_within(prior.support(), values[j], share * width, at);
        slopes.iter().enumerate().for_each(|(i, slope)| jacobian[(i, j)] = *slope);
    }
    jacobian
}

/// Finite differences for [`Effect::push_forward`].
pub fn push_forward_step<E: Effect + ?Sized>(
    effect: &E,
    layout: &Layout,
    response: &[f64],
    values: &[f64],
    tangent: &[f64],
) -> Vec<f64> {
    let largest = |y: &[f64]| y.iter().fold(0.0, |most: f64, y| most.max(y.abs()));
    let (size, length) = (largest(response), largest(tangent));
    if length == 0.0 {
        return vec![0.0; response.len()];
    }
    let step = 1e-5 * size.max(f64::MIN_POSITIVE) / length;
    let moved = |h: f64| {
        let moved: Vec<f64> = response.iter().zip(tangent).map(|(y, v)| y + h * v).collect();
        effect.apply(layout, &moved, values)
    };
    let (above, below) = (moved(step), moved(-step));
    above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * step)).collect()
}

/// Derivative of a function of one number by a central difference, or by a one-sided one of second order at the end of
/// the support.
fn slope_within(
    (low, high): (f64, f64),
    x: f64,
    step: f64,
    at: impl Fn(f64) -> Vec<f64>,
) -> Vec<f64> {
    let step = step.max(1e-9 * x.abs()).max(f64::MIN_POSITIVE);
    let sided = |h: f64| {
        let (here, near, far) = (at(x), at(x + h), at(x + 2.0 * h));
        let slope = |i: usize| (4.0 * near[i] - 3.0 * here[i] - far[i]) / (2.0 * h);
        (0..here.len()).map(slope).collect()
    };
    if x - step < low {
        sided(step)
    } else if x + step > high {
        sided(-step)
    } else {
        let (above, below) = (at(x + step), at(x - step));
        above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * step)).collect()
    }
}
