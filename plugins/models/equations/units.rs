//! Unit checks of equations, among themselves and against the study.

use std::collections::BTreeMap;

use lacuna::data::{Coordinates, Layout, Unit};
use lacuna::expression::{Fault, Scope};
use lacuna::plugin::Context;

use super::Equations;
use super::options::Formula;
use super::system::{Located, START_TIME, key, option_of};

/// Unit of every result; `None` for zero, which has every unit.
type Found = BTreeMap<String, Option<Unit>>;

/// Checks all units; returns the unit of the observed quantities.
pub fn check(
    equations: &Equations,
    scope: &Scope,
    context: &Context<'_>,
) -> Result<Unit, Vec<Located>> {
    let known = known(equations, scope, context);
    let (found, faults) = scope.find_units(&known);
    let mut faults: Vec<Located> =
        faults.into_iter().map(|fault| (option_of(&fault.definition), fault)).collect();
    faults.extend(states(equations, &found, &known, context.layout));
    let (unit, observed) = observed(equations, &found, &context.layout.unit);
    faults.extend(observed);
    if faults.is_empty() { Ok(unit) } else { Err(faults) }
}

/// Returns the units of variables, inputs and states.
pub fn known(
    equations: &Equations,
    scope: &Scope,
    context: &Context<'_>,
) -> BTreeMap<String, Unit> {
    let mut known = given(context);
    let (found, _) = scope.find_units(&known);
    for (name, state) in &equations.state {
        let (start, part) = state.start();
        let of_start = match start {
            Formula::Number(_) => None,
            Formula::Text(_) => found.get(&key(&format!("state.{name}{part}"))).cloned().flatten(),
        };
        let unit = state.unit().cloned().or(of_start).unwrap_or_default();
        known.insert(name.clone(), unit);
    }
    known
}

/// Returns the units of variables and inputs.
fn given(context: &Context<'_>) -> BTreeMap<String, Unit> {
    let inputs = context.given.iter();
    let inputs = inputs.map(|given| (given.name.clone(), given.unit.clone().unwrap_or_default()));
    let axes = context.layout.axes.iter().filter_map(|axis| match &axis.coordinates {
        Coordinates::Grid { unit, .. } => Some((axis.name.clone(), unit.clone())),
        Coordinates::Labels(_) => None,
    });
    inputs.chain(axes).collect()
}

/// Checks that initial values have the units of the states, and rates these units per unit of time.
fn states(
    equations: &Equations,
    found: &Found,
    known: &BTreeMap<String, Unit>,
    layout: &Layout,
) -> Vec<Located> {
    let mut faults = Vec::new();
    let mut demand = |option: String, formula: &Formula, wanted: &Unit, what: String| {
        let found = found.get(&key(&option)).cloned().flatten();
        if let (Some(unit), Formula::Text(text)) = (found, formula)
            && unit != *wanted
        {
            let fault = Fault::new(0..text.len(), format!("{what} has another unit"));
            faults.push((option, mismatch(fault, wanted, &unit)));
        }
    };
    let time = layout.abscissa().map(|(_, _, unit)| unit);
    if let Some(time) = time {
        demand(START_TIME.into(), &equations.start_time, time, "the start time".into());
    }
    for (name, state) in &equations.state {
        let (start, part) = state.start();
        let unit = &known[name];
        demand(format!("state.{name}{part}"), start, unit, format!("the start value of `{name}`"));
        let per_time = time.and_then(|time| ratio(unit, time));
        if let (Some(wanted), Some(text)) = (per_time, equations.rate.get(name)) {
            let rate = Formula::Text(text.clone());
            demand(format!("rate.{name}"), &rate, &wanted, format!("the rate of `{name}`"));
        }
    }
    faults
}

/// Returns the unit of a change per unit of time, written in the usual form if that parses.
pub fn ratio(unit: &Unit, time: &Unit) -> Option<Unit> {
    let unit = &unit.difference();
    let simple = |text: &str| text.chars().all(char::is_alphanumeric);
    let wrapped = |unit: &Unit| match unit.as_str() {
        "" => "1".to_owned(),
        text if simple(text) => text.to_owned(),
        text => format!("({text})"),
    };
    let written = Unit::parse(&format!("{}/{}", wrapped(unit), wrapped(time)));
    written.ok().or_else(|| unit.times(&time.power(-1.0)?))
}

fn mismatch(fault: Fault, wanted: &Unit, found: &Unit) -> Fault {
    let fault = fault.expected(format!("`{wanted}`")).found(format!("`{found}`"));
    if wanted.same_dimension(found) {
        fault.help("numbers are not converted: use one unit for both")
    } else {
        fault
    }
}

/// Returns the common unit of all observed quantities, which must convert to that of the response.
fn observed(equations: &Equations, found: &Found, response: &Unit) -> (Unit, Vec<Located>) {
    let mut common: Option<Unit> = None;
    let mut faults = Vec::new();
    for (_, option, text) in equations.observe.each() {
        let Some(unit) = found.get(&key(&option)).cloned().flatten() else { continue };
        let whole = 0..text.len();
        match &common {
            _ if unit.factor_to(response).is_none() => {
                let fault = Fault::new(whole, "what is observed has another dimension");
                let fault = fault.expected(format!("a unit that converts to `{response}`"));
                faults.push((option, fault.found(format!("`{unit}`"))));
            }
            None => common = Some(unit),
            Some(first) if *first == unit => {}
            Some(first) => {
                let fault = Fault::new(whole, "what is observed has another unit than the first");
                faults.push((option, mismatch(fault, first, &unit)));
            }
        }
    }
    (common.unwrap_or_else(|| response.clone()), faults)
}
