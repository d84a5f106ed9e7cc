//! Checks of equations against the rest of their study.

use lacuna::data::{Axis, Coordinates, Layout, Unit};
use lacuna::plugin::Context;
use lacuna::text::problem::Complaints;

use super::options::{Formula, Observe};
use super::system::{Located, Names, START_TIME, System, scope};
use super::{Equations, units};

/// Reports everything that is wrong with the equations.
pub fn check(equations: &Equations, context: &Context<'_>, complaints: &mut Complaints<'_>) {
    axes(equations, context.layout, complaints);
    times(equations, context.layout, complaints);
    tables(context, complaints);
    let names = Names::of(context);
    let faults = match scope(equations, &names) {
        Ok(scope) => match System::compile(equations, &names) {
            Ok(_) => units::check(equations, &scope, context).err().unwrap_or_default(),
            Err(faults) => faults,
        },
        Err(faults) => faults,
    };
    for fault in faults {
        tell(fault, complaints);
    }
}

/// Reports a fault at its position in the text of an option, or at the option.
fn tell((option, fault): Located, complaints: &mut Complaints<'_>) {
    let spot = complaints.at(&option);
    let spot =
        if fault.span.is_empty() && fault.span.start == 0 { spot } else { spot.inside(fault.span) };
    let problem = spot.say(fault.message);
    problem.expected = fault.expected.map(String::from);
    problem.found = fault.found.map(String::from);
    problem.help.extend(fault.help.map(String::from));
}

/// Returns the unit of the observed quantities, or that of the response if the equations are invalid.
pub fn unit(equations: &Equations, names: &Names, context: &Context<'_>) -> Unit {
    let scope = scope(equations, names).ok();
    let unit = scope.and_then(|scope| units::check(equations, &scope, context).ok());
    unit.unwrap_or_else(|| context.layout.unit.clone())
}

/// Returns the layout of the equations: all observed quantities on the study's axis of labels, and the study's
/// numeric axes.
pub fn layout(equations: &Equations, layout: &Layout) -> Layout {
    let axis = |axis: &Axis| match (&axis.coordinates, &equations.observe) {
        (Coordinates::Labels(_), Observe::Each(labels)) if !labels.is_empty() => {
            Axis::labels(&axis.name, labels.keys())
        }
        _ => axis.clone(),
    };
    Layout { axes: layout.axes.iter().map(axis).collect(), ..layout.clone() }
}

fn is_grid(axis: &Axis) -> bool {
    matches!(axis.coordinates, Coordinates::Grid { .. })
}

/// Checks the axes of the response against the observed quantities and the need for a time axis.
fn axes(equations: &Equations, layout: &Layout, complaints: &mut Complaints<'_>) {
    let grids = layout.axes.iter().filter(|axis| is_grid(axis)).count();
    let labels: Vec<&Axis> = layout.axes.iter().filter(|axis| !is_grid(axis)).collect();
    match (&equations.observe, &labels[..]) {
        (Observe::One(_), []) | (Observe::Each(_), [_]) => {}
        (Observe::Each(each), []) => {
            let names =
                each.keys().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
            complaints
                .at("observe")
                .say("the response has no axis of labels")
                .expected("one expression")
                .found(format!("{} with labels", each.len()))
                .help(format!("add an axis such as `observed = [{names}]` to the response"));
        }
        (Observe::One(_), [axis]) => {
            complaints
                .at("observe")
                .say(format!("the response has the axis `{}` of labels", axis.name))
                .expected("a table with an expression for each label")
                .found("one expression");
        }
        (_, [first, second, ..]) => {
            complaints
                .at("observe")
                .say("equations have one axis of labels at most")
                .found(format!("`{}` and `{}`", first.name, second.name));
        }
    }
    if !equations.state.is_empty() && grids != 1 {
        complaints
            .at("state")
            .say("states need an axis of times")
            .expected("a response with one axis of numbers")
            .found(grids);
    }
}

/// Checks that no point of the response is before the start.
fn times(equations: &Equations, layout: &Layout, complaints: &mut Complaints<'_>) {
    let Some((name, values, unit)) = layout.abscissa() else { return };
    let (Formula::Number(start), Some(first)) = (&equations.start_time, values.first()) else {
        return;
    };
    if !equations.state.is_empty() && first < start {
        complaints
            .at(START_TIME)
            .say(format!("the first {name} of the response is before the start"))
            .expected(format!("at most {first} {unit}"))
            .found(format!("{start} {unit}"));
    }
}

/// Checks that all scenarios have the same tables, in the same units.
fn tables(context: &Context<'_>, complaints: &mut Complaints<'_>) {
    let Some((first, others)) = context.scenarios.split_first() else { return };
    for other in others {
        for function in &first.functions {
            let wrong = match other.function(&function.name) {
                None => format!("has no table `{}`, which `{}` has", function.name, first.name),
                Some(same) if same.unit != function.unit || same.at_unit != function.at_unit => {
                    format!(
                        "has the table `{}` in other units than `{}`",
                        function.name, first.name
                    )
                }
                Some(_) => continue,
            };
            complaints
                .at("")
                .say(format!("the scenario `{}` {wrong}", other.name))
                .expected(format!("`{}` over `{}`", function.unit, function.at_unit));
        }
    }
}
