//! `equations`: a model written in the study, as ordinary differential equations or as formulas.

mod amend;
mod check;
mod flow;
mod integrate;
mod kept;
mod options;
mod respond;
mod shape;
mod stops;
mod system;
#[cfg(test)]
mod tests;
mod units;

use std::collections::BTreeMap;
use std::sync::Arc;

use lacuna::data::Layout;
use lacuna::expression::Fault;
use lacuna::linalg::Matrix;
use lacuna::plugin::model::{Call, EvalError, Gradient, Input, Response, Signature};
use lacuna::plugin::{Amend, Component, Context, Model};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use kept::Kept;
pub use options::{Formula, Method, Observe, Solver, State, StateTable};
use respond::{Answer, Responder};
use shape::Shape;
use system::{Names, System};

/// A model written in the study: ordinary differential equations for states over time and what is observed of them, or
/// formulas alone.
///
/// ```toml
/// [study]
/// title = "A mass on a spring"
///
/// [[parameter]]
/// name = "stiffness"
/// unit = "N/m"
/// prior = { uniform = [50.0, 150.0] }
///
/// [[parameter]]
/// name = "damping"
/// unit = "kg/s"
/// prior = { uniform = [0.1, 2.0] }
///
/// [response]
/// name = "displacement"
/// unit = "mm"
/// axes = { t = { first = 0.1, last = 10.0, count = 100, unit = "s" } }
///
/// [model]
/// use = "equations"
/// state = { x = { start = 0.01, unit = "m" }, v = { start = 0.0, unit = "m/s" } }
/// rate = { x = "v", v = "-(stiffness * x + damping * v) / mass" }
/// where = { mass = "2 {kg}" }
/// observe = "x"
///
/// [design]
/// use = "latin_hypercube"
/// runs = 40
///
/// [surrogate]
/// use = "polynomial_chaos"
/// ```
///
/// Expressions use the parameters of the study, `fixed` values and the values of scenarios by their names, the states,
/// the definitions of `where`, and the response's axes of numbers: the axis is the time, here `t`. Tables of a
/// scenario, such as a measured force, are called as functions: `force(t)`, straight between their points, constant
/// beyond the first and the last. An axis of labels names what is observed: `observe = { position = "x", speed =
/// "abs(v)" }`. Without states the response is the expression at each point of its axes.
///
/// Units are checked before anything runs and never converted inside expressions: a number with its unit is written
/// `9.81 {m/s2}`, a plain number has none. What is observed is converted to the unit of the response.
///
/// Rates may break: where a condition changes with time, or a table has a point, integration stops and goes on behind,
/// and the derivatives by parameters are corrected where the rates jump. The guide `docs/equations.md` has all functions,
/// the solvers and their limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Equations {
    /// The states: for each a start value (a number, or an expression of the inputs), or a table `{ start = …, unit = …
    /// }`. A start that is an expression brings its unit; one that is a number has the `unit`, or none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub state: BTreeMap<String, State>,
    /// The rate of each state by time: an expression.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rate: BTreeMap<String, String>,
    /// When the states have their start values: a number in the unit of the time axis, or an expression of the inputs.
    #[serde(default = "zero")]
    pub start_time: Formula,
    /// Definitions: names for expressions that other expressions use. Their order does not matter.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub definitions: BTreeMap<String, String>,
    /// What is observed: one expression, or one for each label of the response's axis of labels.
    pub observe: Observe,
    /// How the states are integrated.
    #[serde(default)]
    pub solver: Solver,
    #[serde(skip)]
    #[schemars(skip)]
    kept: Kept,
}

fn zero() -> Formula {
    Formula::Number(0.0)
}

impl Equations {
    /// The options under which the start time and the start values stand.
    fn starts(&self) -> Vec<String> {
        let states = self.state.iter();
        let states = states.map(|(name, state)| format!("state.{name}{}", state.start().1));
        [system::START_TIME.to_owned()].into_iter().chain(states).collect()
    }

    /// The system that a call is made of.
    fn system(&self, call: &Call<'_>) -> Result<Arc<System>, EvalError> {
        let names = Names {
            variables: Names::variables(call.layout),
            inputs: call.names.to_vec(),
            functions: call.scenario.functions.clone(),
        };
        self.kept.get(&names, || System::compile(self, &names)).map_err(|faults| {
            let lines = faults.into_iter().map(|(option, fault)| {
                // The fault of a definition names it already.
                let fault = Fault { definition: String::new(), ..fault };
                format!("`model.{option}`: {fault}")
            });
            EvalError::Fatal(lines.collect::<Vec<_>>().join("\n"))
        })
    }

    fn answer(&self, call: &Call<'_>, derivatives: bool) -> Result<Answer, EvalError> {
        let (found, expected) = (call.inputs.len(), call.names.len());
        if found != expected {
            let message = format!("the equations take {expected} inputs and were given {found}");
            return Err(EvalError::Fatal(message));
        }
        let system = self.system(call)?;
        let shape = Shape::of(call.layout, system.variables.len(), &system.labels);
        let shape = shape.map_err(EvalError::Fatal)?;
        if let Some(i) = call.inputs.iter().position(|x| !x.is_finite()) {
            let (name, value) = (&call.names[i], call.inputs[i]);
            return Err(EvalError::Rejected(format!("the input `{name}` is {value}")));
        }
        let length = call.layout.len();
        if length == 0 {
            return Err(EvalError::Fatal("the response has no points".to_owned()));
        }
        let (solver, inputs) = (&self.solver, call.inputs);
        let responder = Responder { system: &system, shape: &shape, solver, inputs, length };
        responder.answer(derivatives).map_err(EvalError::Rejected)
    }
}

impl Equations {
    fn with_derivatives(&self, call: &Call<'_>) -> Result<(Response, Matrix), EvalError> {
        let Answer { values, jacobian, facts } = self.answer(call, true)?;
        let missing = || EvalError::Fatal("the derivatives are missing".to_owned());
        Ok((Response { values, valid: true, facts }, jacobian.ok_or_else(missing)?))
    }
}

impl Component for Equations {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        check::check(self, context, complaints);
    }
}

impl Model for Equations {
    fn signature(&self, context: &Context<'_>) -> Signature {
        let names = Names::of(context);
        let system = System::compile(self, &names).ok();
        // Of equations that are wrong the check tells; their inputs are not to be complained of again.
        let uses = |name: &str| match (&system, names.inputs.iter().position(|n| n == name)) {
            (Some(system), Some(i)) => system.uses(i),
            (None, _) => true,
            (Some(_), None) => false,
        };
        let used = context.given.iter().filter(|given| uses(&given.name));
        let inputs = used.map(|given| Input {
            name: given.name.clone(),
            unit: given.unit.clone().unwrap_or_default(),
            default: None,
            range: (f64::NEG_INFINITY, f64::INFINITY),
            description: "an input of the equations".to_owned(),
        });
        let unit = check::unit(self, &names, context);
        Signature {
            inputs: inputs.collect(),
            layout: Layout { unit, ..check::layout(self, context.layout) },
            resamples: true,
        }
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        let Answer { values, facts, .. } = self.answer(call, false)?;
        Ok(Response { values, valid: true, facts })
    }

    fn gradient(&self) -> Option<&dyn Gradient> {
        Some(self)
    }

    fn amend(&self) -> Option<&dyn Amend> {
        (!self.state.is_empty()).then_some(self)
    }
}

impl Gradient for Equations {
    fn jacobian(&self, call: &Call<'_>) -> Result<Matrix, EvalError> {
        self.with_derivatives(call).map(|(_, jacobian)| jacobian)
    }

    fn with_response(&self, call: &Call<'_>) -> Option<Result<(Response, Matrix), EvalError>> {
        Some(self.with_derivatives(call))
    }
}

lacuna::register!(Model, "equations", Equations, aliases: ["ode", "odes"]);
