//! Contract of targets.

use lacuna::data::Parameter;
use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::Density;
use lacuna::plugin::density::BoundDensity;

use crate::judge::{Check, calm, judge, same_on_threads, slope};

/// Tests a target against its contract, with parameters whose priors it is meant for.
///
/// - At draws from the priors the log density is finite or minus infinity, and finite for at least one of them.
/// - It is never plus infinity or NaN, not even at extreme or non-finite points.
/// - The value at a point does not depend on the other points of a batch, nor on the number of threads.
/// - The gradient is returned with the density of its point, agrees with finite differences, and is zero where the
///   density is zero.
pub fn density(
    name: &str,
    density: &dyn Density,
    parameters: &[Parameter],
) -> Result<(), Vec<String>> {
    let bound = match calm("binding", || density.bind(parameters)) {
        Ok(Ok(bound)) => bound,
        Ok(Err(stop)) => {
            return Err(vec![format!("target `{name}`, binds: refused: {}", stop.message)]);
        }
        Err(panic) => return Err(vec![format!("target `{name}`, {panic}")]),
    };
    let bound = &*bound;
    let checks: [Check<'_>; 4] = [
        ("judges draws", Box::new(|| judges_draws(bound, parameters))),
        ("bears strange points", Box::new(|| bears_strange_points(bound, parameters))),
        ("judges each point alone", Box::new(|| judges_each_point_alone(bound, parameters))),
        ("knows its derivatives", Box::new(|| knows_its_derivatives(bound, parameters))),
    ];
    judge("target", name, &checks)
}

/// Independent draws from the priors.
fn draws(parameters: &[Parameter]) -> Matrix {
    let mut rng = Stream::root(11).generator();
    Matrix::from_fn(37, parameters.len(), |_, j| parameters[j].prior.sample(&mut rng))
}

fn sound(value: f64) -> bool {
    value.is_finite() || value == f64::NEG_INFINITY
}

fn judges_draws(bound: &dyn BoundDensity, parameters: &[Parameter]) -> Result<(), String> {
    let points = draws(parameters);
    let values = bound.log_density(&points);
    if values.len() != points.rows() {
        return Err(format!("{} points have {} values", points.rows(), values.len()));
    }
    match values.iter().position(|value| !sound(*value)) {
        Some(i) => Err(format!("it is {} at {:?}", values[i], points.row(i))),
        None if values.iter().all(|value| value.is_infinite()) => {
            Err("no draw from the priors has a density".into())
        }
        None => Ok(()),
    }
}

fn bears_strange_points(bound: &dyn BoundDensity, parameters: &[Parameter]) -> Result<(), String> {
    let middle: Vec<f64> = parameters.iter().map(|p| p.prior.quantile(0.5)).collect();
    for j in 0..middle.len() {
        let (low, high) = parameters[j].prior.support();
        for strange in [0.0, -0.0, low, high, 1e300, -1e300, f64::INFINITY, f64::NAN] {
            let mut point = middle.clone();
            point[j] = strange;
            let what = format!("`{}` = {strange}", parameters[j].name);
            let row = Matrix::from_rows(point.len(), [&point]);
            let value = calm(&what, || bound.log_density(&row))?[0];
            let (same, gradient) = calm(&what, || bound.gradient(&point))?;
            if !sound(value) {
                return Err(format!("it is {value} for {what}"));
            }
            if same != value {
                return Err(format!("it is {value}, with its gradient {same}, for {what}"));
            }
            if value.is_infinite() && gradient.iter().any(|slope| *slope != 0.0) {
                return Err(format!("no density has the gradient {gradient:?} for {what}"));
            }
        }
    }
    Ok(())
}

fn judges_each_point_alone(
    bound: &dyn BoundDensity,
    parameters: &[Parameter],
) -> Result<(), String> {
    let points = draws(parameters);
    let together = bound.log_density(&points);
    for (i, value) in together.iter().enumerate() {
        let alone = bound.log_density(&points.select_rows(&[i]))[0];
        if alone.to_bits() != value.to_bits() {
            return Err(format!("a point alone has {alone}, with others {value}"));
        }
    }
    if !bound.log_density(&points.select_rows(&[])).is_empty() {
        return Err("no points have values".into());
    }
    same_on_threads(|| Ok(bound.log_density(&points)))
}

fn knows_its_derivatives(bound: &dyn BoundDensity, parameters: &[Parameter]) -> Result<(), String> {
    let points = draws(parameters);
    for point in points.iter_rows() {
        let (value, gradient) = bound.gradient(point);
        if gradient.len() != parameters.len() {
            return Err(format!("{} parameters have {} slopes", parameters.len(), gradient.len()));
        }
        if value.is_infinite() {
            continue;
        }
        for (j, parameter) in parameters.iter().enumerate() {
            // Steps in units of the prior's width, small compared with the scale of any target.
            let width = parameter.prior.quantile(0.75) - parameter.prior.quantile(0.25);
            let f = |x: &[f64]| bound.log_density(&Matrix::from_rows(x.len(), [x]));
            let [near, far] = [1e-4, 2e-4].map(|step| slope(f, point, j, step * width)[0]);
            // The edge of a support may be closer than the step.
            if !(near.is_finite() && far.is_finite()) {
                continue;
            }
            let difference = (4.0 * near - far) / 3.0;
            let rounding = 1e-6 * (difference.abs() + value.abs().max(1.0) / width);
            if (gradient[j] - difference).abs() > rounding + (difference - near).abs() {
                let (name, given) = (&parameter.name, gradient[j]);
                let breach = format!("the derivative by `{name}` is {given} where differences");
                return Err(format!("{breach} give {difference} at {point:?}"));
            }
        }
    }
    Ok(())
}
