//! Contract of effects.

use lacuna::math::random::{Stream, normal};
use lacuna::matrix::Matrix;
use lacuna::plugin::Effect;
use lacuna::plugin::effect::Situation;

use crate::judge::{Check, agree, judge, layout, slope, twice};

/// Tests an effect against its contract.
///
/// - It has a description, and its parameters have distinct names.
/// - With its size at `absent` it changes nothing, not even a bit, whatever its indices are.
/// - `absent` and every `start` lie in the support of the priors.
/// - The response keeps its number of values, all finite, and is reproducible.
/// - There are starts, they lie in the support of the priors, and they change the response.
/// - The derivatives by the parameters and along a direction of the response agree with finite differences.
pub fn effect(name: &str, effect: &dyn Effect) -> Result<(), Vec<String>> {
    let checks: [Check<'_>; 5] = [
        ("describes itself", Box::new(|| describes_itself(effect))),
        ("can be absent", Box::new(|| can_be_absent(effect))),
        ("answers", Box::new(|| answers(effect))),
        ("can be started", Box::new(|| can_be_started(effect))),
        ("knows its derivatives", Box::new(|| knows_its_derivatives(effect))),
    ];
    judge("effect", name, &checks)
}

/// A response of the magnitude of strains, without zeros.
fn response() -> Vec<f64> {
    let mut rng = Stream::root(2).generator();
    (0..layout().len()).map(|i| 1e-4 * (1.0 + i as f64 + 0.3 * normal(&mut rng))).collect()
}

/// Draws of the effect's parameters from their priors, one per row.
fn draws(effect: &dyn Effect) -> Matrix {
    let parameters = effect.parameters(&layout());
    let mut rng = Stream::root(3).generator();
    Matrix::from_fn(5, parameters.len(), |_, j| parameters[j].prior.sample(&mut rng))
}

fn describes_itself(effect: &dyn Effect) -> Result<(), String> {
    let words = effect.describe();
    for (what, text) in
        [("title", words.title), ("formula", words.formula), ("source", words.source)]
    {
        if text.trim().is_empty() {
            return Err(format!("its {what} is empty"));
        }
    }
    let parameters = effect.parameters(&layout());
    match twice(parameters.iter().map(|p| p.name.as_str())) {
        Some(name) => Err(format!("two parameters are called `{name}`")),
        None => Ok(()),
    }
}

fn can_be_absent(effect: &dyn Effect) -> Result<(), String> {
    let (layout, response) = (layout(), response());
    let (parameters, absent) = (effect.parameters(&layout), effect.absent(&layout));
    if parameters.len() != absent.len() {
        return Err(format!("{} parameters, {} values", parameters.len(), absent.len()));
    }
    for (parameter, absent) in parameters.iter().zip(&absent) {
        let (low, high) = parameter.prior.support();
        for (what, x) in [("absence", *absent), ("start", parameter.start)] {
            if !(low..=high).contains(&x) {
                return Err(format!("`{}` at its {what} {x} leaves its prior", parameter.name));
            }
        }
    }
    for drawn in draws(effect).iter_rows() {
        let without = [&absent[..1], &drawn[1..]].concat();
        if effect.apply(&layout, &response, &without) != response {
            return Err(format!("it changes the response with {without:?}"));
        }
    }
    Ok(())
}

fn can_be_started(effect: &dyn Effect) -> Result<(), String> {
    let (layout, response) = (layout(), response());
    let layouts = layout.clone().into();
    let noise = vec![1e-5; response.len()];
    let situation = Situation { layouts: &layouts, response: &response, noise: &noise };
    let starts = effect.starts(&layout, &situation);
    if starts.is_empty() {
        return Err("it has no starts".into());
    }
    let parameters = effect.parameters(&layout);
    for start in &starts {
        if start.len() != parameters.len() {
            return Err(format!("{start:?} for {} parameters", parameters.len()));
        }
        for (parameter, x) in parameters.iter().zip(start) {
            if parameter.prior.log_density(*x) == f64::NEG_INFINITY {
                return Err(format!("`{}` at its start {x} leaves its prior", parameter.name));
            }
        }
        if effect.apply(&layout, &response, start) == response {
            return Err(format!("with {start:?} it changes nothing"));
        }
    }
    Ok(())
}

fn answers(effect: &dyn Effect) -> Result<(), String> {
    let (layout, response) = (layout(), response());
    for values in draws(effect).iter_rows() {
        let after = effect.apply(&layout, &response, values);
        if after.len() != response.len() {
            return Err(format!("{} values become {}", response.len(), after.len()));
        }
        if let Some(y) = after.iter().find(|y| !y.is_finite()) {
            return Err(format!("with {values:?} the response is {y}"));
        }
        if effect.apply(&layout, &response, values) != after {
            return Err("the same values give another response".into());
        }
    }
    Ok(())
}

/// Tolerance: central differences with steps of 1e-5 are accurate to about 1e-8 for smooth effects of order one.
const TOLERANCE: f64 = 1e-5;

fn knows_its_derivatives(effect: &dyn Effect) -> Result<(), String> {
    let (layout, response) = (layout(), response());
    let mut rng = Stream::root(4).generator();
    let tangent: Vec<f64> = response.iter().map(|y| y * normal(&mut rng)).collect();
    for values in draws(effect).iter_rows() {
        let jacobian = effect.by_parameters(&layout, &response, values);
        if (jacobian.rows(), jacobian.columns()) != (response.len(), values.len()) {
            return Err("the derivative by the parameters has the wrong shape".into());
        }
        for j in 0..values.len() {
            let step = 1e-5 * values[j].abs().max(1e-3);
            let by = slope(|v| effect.apply(&layout, &response, v), values, j, step);
            let what = format!("the derivative by parameter {} of value", j + 1);
            agree(&what, &jacobian.column(j), &by, TOLERANCE)?;
        }
        let pushed = effect.push_forward(&layout, &response, values, &tangent);
        let along = |h: &[f64]| {
            let moved = response.iter().zip(&tangent).map(|(y, v)| y + h[0] * v);
            effect.apply(&layout, &moved.collect::<Vec<_>>(), values)
        };
        let expected = slope(along, &[0.0], 0, 1e-5);
        agree("the derivative along a direction of value", &pushed, &expected, TOLERANCE)?;
    }
    Ok(())
}
