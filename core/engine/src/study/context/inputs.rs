//! Consistency of the values that a study sets with the inputs of its model, in one scenario.

use std::collections::BTreeSet;

use lacuna::data::{Parameter, Unit};
use lacuna::plugin::model::{Input, Signature};
use lacuna::text::Complaints;
use lacuna::text::nearest::nearest;
use lacuna::text::problem::Problem;

use crate::study::inputs::used_in_expressions;
use crate::study::{Study, field};

/// Reports values without an input, inputs without a value, units that do not convert, and values outside the model's
/// range.
pub(super) fn check(
    study: &Study,
    scenario: usize,
    signature: &Signature,
    complaints: &mut Complaints<'_>,
) {
    let find = |name: &str| signature.inputs.iter().find(|input| input.name == name);
    let used = used_in_expressions(study);
    let section = study.model.as_ref().map(|model| &model.common);
    let computed = |name: &str| section.is_some_and(|keys| keys.computed.contains_key(name));
    let mut set: Vec<&str> = Vec::new();
    let mut set_by_fields = BTreeSet::new();
    field::check(study, signature, &mut set_by_fields, complaints);
    for (parameter, unknown) in study.parameters.iter().zip(&study.unknowns) {
        if !unknown.acts_in(scenario) || unknown.of_field() {
            continue;
        }
        let path = format!("parameter.{}", unknown.name);
        match find(&unknown.name) {
            Some(input) if !computed(&unknown.name) => {
                set.push(&unknown.name);
                input_fits(parameter, input, &path, complaints);
            }
            _ if used.contains(&unknown.name) => {}
            _ => no_input(&unknown.name, &format!("{path}.name"), signature, complaints),
        }
    }
    for name in section.into_iter().flat_map(|keys| keys.computed.keys()) {
        let path = format!("model.computed.{name}");
        match find(name) {
            Some(input) => {
                set.push(name);
                computed_fits(study, scenario, input, &path, complaints);
            }
            None => no_input(name, &path, signature, complaints),
        }
    }
    for condition in &study.scenarios[scenario].values {
        let Some(input) = find(&condition.name) else { continue };
        let path = format!("scenario.{}.values.{}", study.scenarios[scenario].name, condition.name);
        known_fits(condition.value, condition.unit.as_ref(), input, &path, &mut set, complaints);
    }
    for (name, quantity) in section.into_iter().flat_map(|keys| &keys.fixed) {
        let path = format!("model.fixed.{name}");
        match find(name) {
            Some(input) => {
                let unit = quantity.unit.as_ref();
                known_fits(quantity.value, unit, input, &path, &mut set, complaints);
            }
            None => no_input(name, &path, signature, complaints),
        }
    }
    if let Some(seed) = section.and_then(|keys| keys.seed.as_ref()) {
        match find(seed.as_str()) {
            Some(input) => known_fits(1.0, None, input, "model.seed", &mut set, complaints),
            None => no_input(seed.as_str(), "model.seed", signature, complaints),
        }
    }
    let is_set = |name: &String| set.contains(&name.as_str()) || set_by_fields.contains(name);
    let missing = |input: &&Input| input.default.is_none() && !is_set(&input.name);
    for input in signature.inputs.iter().filter(missing) {
        let scenario = &study.scenarios[scenario].name;
        let place =
            if scenario.is_empty() { String::new() } else { format!(" in scenario `{scenario}`") };
        complaints
            .at("model")
            .say(format!("nothing sets the model's input `{}`{place}", input.name))
            .help(format!(
                "add a `[[parameter]]` of that name, or `fixed = {{ {} = … }}`",
                input.name
            ));
    }
}

fn no_input(name: &str, path: &str, signature: &Signature, complaints: &mut Complaints<'_>) {
    let names = || signature.inputs.iter().map(|input| input.name.as_str());
    let listed = names().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
    let problem: &mut Problem = complaints
        .at(path)
        .say(format!("the model does not use `{name}`"))
        .expected(format!("one of its inputs {listed}"));
    if let Some(near) = nearest(name, names()) {
        problem.help(format!("did you mean `{near}`?"));
    }
}

/// Reports a known value that is set twice, whose unit does not convert to the input's, or that is not finite or lies outside
/// its range.
fn known_fits<'s>(
    value: f64,
    unit: Option<&Unit>,
    input: &'s Input,
    path: &str,
    set: &mut Vec<&'s str>,
    complaints: &mut Complaints<'_>,
) {
    if set.contains(&input.name.as_str()) {
        complaints
            .at(path)
            .say(format!("`{}` is set twice: it is a parameter or has another value", input.name))
            .help("take it out of one of the two");
    }
    set.push(&input.name);
    match unit.map_or(Some(value), |unit| unit.convert(value, &input.unit)) {
        None => {
            complaints
                .at(path)
                .say(format!("`{}` has the wrong unit", input.name))
                .expected(format!("a unit that converts to `{}`", input.unit))
                .found(unit.map_or(String::new(), |unit| format!("`{unit}`")));
        }
        Some(value) if !value.is_finite() => {
            complaints
                .at(path)
                .say(format!("`{}` is not finite", input.name))
                .expected("a finite number")
                .found(value);
        }
        Some(value) if !(input.range.0..=input.range.1).contains(&value) => {
            out_of_range(input, value, &input.unit.to_string(), path, complaints);
        }
        Some(_) => {}
    }
}

/// Reports an expression whose unit does not convert to that of the input.
fn computed_fits(
    study: &Study,
    scenario: usize,
    input: &Input,
    path: &str,
    complaints: &mut Complaints<'_>,
) {
    let Ok(Some(computed)) = study.computed(scenario) else { return };
    let place = computed.names.iter().position(|name| name == &input.name);
    let Some(unit) = place.map(|i| &computed.units[i]) else { return };
    if unit.factor_to(&input.unit).is_none() {
        complaints
            .at(path)
            .say(format!("the expression of `{}` has the wrong unit", input.name))
            .expected(format!("a unit that converts to `{}`", input.unit))
            .found(format!("`{unit}`"));
    }
}

fn input_fits(parameter: &Parameter, input: &Input, path: &str, complaints: &mut Complaints<'_>) {
    let Some(factor) = parameter.unit.factor_to(&input.unit) else {
        complaints
            .at(&format!("{path}.unit"))
            .say(format!("`{}` has the wrong unit", parameter.name))
            .expected(format!("a unit that converts to `{}`", input.unit))
            .found(format!("`{}`", parameter.unit));
        return;
    };
    let (low, high) = parameter.design.support();
    for edge in [low, high] {
        // Conversions round; a bound that agrees to 12 digits is the bound.
        let slack = 1e-12 * (edge * factor).abs();
        let value = edge * factor;
        if value < input.range.0 - slack || value > input.range.1 + slack {
            let key = format!("{path}.design");
            out_of_range(input, value, &input.unit.to_string(), &key, complaints);
        }
    }
}

fn out_of_range(
    input: &Input,
    value: f64,
    unit: &str,
    path: &str,
    complaints: &mut Complaints<'_>,
) {
    let (low, high) = input.range;
    let range = match (low.is_finite(), high.is_finite()) {
        (true, true) => format!("values from {low} to {high} {unit}"),
        (true, false) => format!("values from {low} {unit} up"),
        _ => format!("values up to {high} {unit}"),
    };
    complaints
        .at(path)
        .say(format!("`{}` leaves the range in which the model answers", input.name))
        .expected(range)
        .found(format!("{value} {unit}"));
}
