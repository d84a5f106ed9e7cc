//! `skeleton`: exponential decay.

use lacuna::data::{Axis, Coordinates, Layout, Unit};
use lacuna::matrix::Matrix;
use lacuna::plugin::model::{Call, EvalError, Gradient, Input, Response, Signature};
use lacuna::plugin::{Component, Context, Model};
use lacuna::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Exponential decay: `amplitude exp(-rate t) + background` at any times.
///
/// Charge of a capacitor, activity of one isotope, a first-order reaction. The response has one axis, a grid in
/// seconds; amplitude and rate are the inputs. For a sum of several decays use `equations`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Value after complete decay, in the unit of the response.
    pub background: f64,
}

impl Component for Skeleton {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if !self.background.is_finite() {
            complaints
                .at("background")
                .say("a response would not be finite")
                .expected("a finite number")
                .found(self.background);
        }
    }
}

/// The second, the unit of the model's time.
fn second() -> Unit {
    Unit::parse("s").unwrap_or_default()
}

impl Model for Skeleton {
    fn signature(&self, context: &Context<'_>) -> Signature {
        let input = |name: &str, unit: Unit, description: &str| Input {
            name: name.to_owned(),
            unit,
            default: Some(1.0),
            range: (f64::NEG_INFINITY, f64::INFINITY),
            description: description.to_owned(),
        };
        let response = &context.layout.unit;
        let rate = second().power(-1.0).unwrap_or_default();
        let inputs = vec![
            input("amplitude", response.clone(), "the response at time zero, less the background"),
            input("rate", rate, "the share that decays in a unit of time"),
        ];
        let times = (0..=10).map(|i| 0.1 * f64::from(i)).collect();
        let axes = vec![Axis::grid("time", times, second())];
        let layout = Layout { name: context.layout.name.clone(), unit: response.clone(), axes };
        Signature { inputs, layout, resamples: true }
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        let ([amplitude, rate], times) = (inputs(call)?, times(call.layout)?);
        let value = |t: &f64| amplitude * (-rate * t).exp() + self.background;
        let values: Vec<f64> = times.iter().map(value).collect();
        if let Some(i) = values.iter().position(|y| !y.is_finite()) {
            let (y, place) = (values[i], call.layout.describe(i));
            return Err(EvalError::Rejected(format!("the response is {y} at {place}")));
        }
        Ok(Response { values, valid: true, facts: Vec::new() })
    }

    fn gradient(&self) -> Option<&dyn Gradient> {
        Some(self)
    }
}

impl Gradient for Skeleton {
    fn jacobian(&self, call: &Call<'_>) -> Result<Matrix, EvalError> {
        let ([amplitude, rate], times) = (inputs(call)?, times(call.layout)?);
        Ok(Matrix::from_fn(times.len(), 2, |i, j| {
            let decayed = (-rate * times[i]).exp();
            if j == 0 { decayed } else { -times[i] * amplitude * decayed }
        }))
    }
}

fn inputs(call: &Call<'_>) -> Result<[f64; 2], EvalError> {
    let found = call.inputs.len();
    let inputs: [f64; 2] = call.inputs.try_into().map_err(|_| {
        EvalError::Fatal(format!("expected the inputs `amplitude` and `rate`, found {found}"))
    })?;
    if inputs.iter().any(|x| x.is_nan()) {
        return Err(EvalError::Rejected("an input is not a number".into()));
    }
    Ok(inputs)
}

fn times(layout: &Layout) -> Result<&[f64], EvalError> {
    match &layout.axes[..] {
        [Axis { name, coordinates: Coordinates::Grid { values, unit }, .. }]
            if name == "time" && *unit == second() =>
        {
            Ok(values)
        }
        _ => Err(EvalError::Fatal("expected a response with one axis, `time` in `s`".into())),
    }
}

lacuna::register!(Model, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::data::Scenario;

    fn respond(amplitude: f64, rate: f64) -> Vec<f64> {
        let layout = Layout {
            axes: vec![Axis::grid("time", vec![0.0, 1.0, 2.0], second())],
            ..Layout::number("y")
        };
        let (inputs, scenario) = ([amplitude, rate], Scenario::default());
        Skeleton::default().predict(&Call::new(&inputs, &[], &layout, &scenario)).unwrap().values
    }

    #[test]
    fn it_keeps_the_contract() {
        let folder = std::env::temp_dir();
        let layout = Layout::number("y");
        let context = Context::new(&folder, &[], &layout);
        let judged = lacuna_contract::model("skeleton", &Skeleton::default(), &context, &folder);
        assert_eq!(judged, Ok(()));
    }

    #[test]
    fn it_halves_in_each_half_life() {
        let found = respond(4.0, 2.0_f64.ln());
        assert!(found.iter().zip([4.0, 2.0, 1.0]).all(|(y, right)| (y - right).abs() < 1e-15));
    }
}
