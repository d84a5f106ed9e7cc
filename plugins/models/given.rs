//! Models that take whatever inputs a study gives: the user's own commands and functions.

use std::collections::BTreeMap;

use lacuna::data::{Axis, Coordinates, Layout, Scenario, Unit};
use lacuna::plugin::model::{Call, EvalError, Input, Response, Signature};
use lacuna::plugin::{Context, Fact};
use lacuna::text::nearest::nearest;
use lacuna::text::problem::Complaints;
use serde_json::{Map, Value, json};

/// Returns the signature made of the study's own inputs and layout; an input has the unit given in `units`, else that
/// of the study.
pub fn signature(context: &Context<'_>, units: &BTreeMap<String, Unit>) -> Signature {
    let input = |given: &lacuna::plugin::Given| {
        let unit = units.get(&given.name).or(given.unit.as_ref());
        Input {
            name: given.name.clone(),
            unit: unit.cloned().unwrap_or_else(Unit::dimensionless),
            default: None,
            range: (f64::NEG_INFINITY, f64::INFINITY),
            description: "as the study gives it".to_owned(),
        }
    };
    Signature {
        inputs: context.given.iter().map(input).collect(),
        layout: context.layout.clone(),
        resamples: false,
    }
}

/// Reports units for inputs that the study does not give.
pub fn check_units(
    units: &BTreeMap<String, Unit>,
    context: &Context<'_>,
    complaints: &mut Complaints<'_>,
) {
    let names = || context.given.iter().map(|given| given.name.as_str());
    for name in units.keys().filter(|name| !names().any(|given| given == *name)) {
        let problem = complaints
            .at(&format!("units.{name}"))
            .say(format!("the study gives no input `{name}`"))
            .expected(listed(names()));
        if let Some(near) = nearest(name, names()) {
            problem.help(format!("did you mean `{near}`?"));
        }
    }
}

/// Formats the inputs of a study for a message.
pub fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    match names[..] {
        [] => "none: the study has no inputs".to_owned(),
        [only] => format!("`{only}`"),
        _ => format!("one of {}", crate::readers::listed(&names)),
    }
}

/// Fails unless a call has one finite number for each name.
pub fn sound(call: &Call<'_>) -> Result<(), EvalError> {
    let (names, inputs) = (call.names.len(), call.inputs.len());
    if names != inputs {
        return Err(EvalError::Fatal(format!("expected {names} inputs, found {inputs}")));
    }
    match call.names.iter().zip(call.inputs).find(|(_, x)| !x.is_finite()) {
        None => Ok(()),
        Some((name, x)) => Err(EvalError::Rejected(format!("the input `{name}` is {x}"))),
    }
}

/// Builds a response from values in the order of the layout; fails if their number is wrong or one is not finite.
pub fn response(
    values: Vec<f64>,
    layout: &Layout,
    facts: Vec<Fact>,
) -> Result<Response, EvalError> {
    let (found, expected) = (values.len(), layout.len());
    if found != expected {
        let text = format!("the response has {found} values, expected {expected}");
        return Err(EvalError::Rejected(text));
    }
    match values.iter().position(|y| !y.is_finite()) {
        None => Ok(Response { values, valid: true, facts }),
        Some(i) => {
            let place = layout.describe(i);
            let at = if place.is_empty() { String::new() } else { format!(" at {place}") };
            Err(EvalError::Rejected(format!("the response is {}{at}", values[i])))
        }
    }
}

/// Converts a layout to a JSON document: `name`, `unit`, and `axes`, each with `name` and either `labels` or `values`
/// and `unit`.
pub fn layout_document(layout: &Layout) -> Value {
    let axis = |axis: &Axis| match &axis.coordinates {
        Coordinates::Labels(labels) => json!({ "name": axis.name, "labels": labels }),
        Coordinates::Grid { values, unit } => {
            json!({ "name": axis.name, "values": values, "unit": unit.as_str() })
        }
    };
    let axes: Vec<Value> = layout.axes.iter().map(axis).collect();
    json!({ "name": layout.name, "unit": layout.unit.as_str(), "axes": axes })
}

/// Converts a scenario to a JSON document: `name`, `values` by name, and `functions`, each with `at`, `at_unit`,
/// `values` and `unit`.
pub fn scenario_document(scenario: &Scenario) -> Value {
    let values: Map<String, Value> =
        scenario.values.iter().map(|given| (given.name.clone(), json!(given.value))).collect();
    let function = |function: &std::sync::Arc<lacuna::data::Function>| {
        let document = json!({
            "at": function.at,
            "at_unit": function.at_unit.as_str(),
            "values": function.values,
            "unit": function.unit.as_str(),
        });
        (function.name.clone(), document)
    };
    let functions: Map<String, Value> = scenario.functions.iter().map(function).collect();
    json!({ "name": scenario.name, "values": values, "functions": functions })
}
