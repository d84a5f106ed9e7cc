//! `equations`: a model written in the study, as ordinary differential equations or as formulas.

mod amend;
mod check;
mod flow;
mod integrate;
mod jacobian;
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
use lacuna::plugin::model::{Call, EvalError, Gradient, Input, Response, Signature};
use lacuna::plugin::{Amend, Component, Context, Model};
use lacuna::text::problem::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use kept::Kept;
use respond::{Answer, Responder};
use shape::Shape;
use system::{Names, System};

pub use options::{Formula, Method, Observe, Solver, State, StateTable};

/// A model written in the study: ordinary differential equations for states over time and expressions for the
/// observed quantities, or formulas alone.
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
/// Expressions use the parameters of the study, `fixed` values and the values of scenarios by their names, the
/// states, the definitions of `where`, and the response's numeric axes: the axis is the time, here `t`. Tables of a
/// scenario, such as a measured force, are called as functions: `force(t)`, interpolated between their points as
/// the scenario states, with constant values beyond the first and the last; so are random fields (`[[field]]`). An axis of labels names the observed quantities:
/// `observe = { position = "x", speed = "abs(v)" }`. Without states the response is the expression at each point of
/// its axes.
///
/// Units are checked before anything runs and never converted inside expressions: a number with a unit is written
/// `9.81 {m/s2}`, a plain number has none. The observed quantities are converted to the unit of the response.
///
/// Rates may be discontinuous: at a condition that changes with time, or at a point of a table, the integration stops
/// and restarts, and the derivatives with respect to the parameters are corrected where the rates jump. The guide
/// `docs/equations.md` lists all functions, the solvers and their limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Equations {
    /// States: for each an initial value (a number, or an expression of the inputs), or a table
    /// `{ start = …, unit = … }`. An expression has its own unit; a number has the `unit`, or none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub state: BTreeMap<String, State>,
    /// Time derivative of each state, as an expression.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rate: BTreeMap<String, String>,
    /// Time at which the states have their initial values: a number in the unit of the time axis, or an expression of
    /// the inputs.
    #[serde(default = "zero")]
    pub start_time: Formula,
    /// Definitions: names for expressions that other expressions use. Their order does not matter.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub definitions: BTreeMap<String, String>,
    /// Observed quantities: one expression, or one for each label of the response's axis of labels.
    pub observe: Observe,
    /// Integration method and tolerances.
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
    /// Returns the options that contain the start time and the initial values.
    fn starts(&self) -> Vec<String> {
        let states = self.state.iter();
        let states = states.map(|(name, state)| format!("state.{name}{}", state.start().1));
        [system::START_TIME.to_owned()].into_iter().chain(states).collect()
    }

    /// Returns the compiled system for the names of a call.
    fn system(&self, call: &Call<'_>) -> Result<Arc<System>, EvalError> {
        let names = Names {
            variables: Names::variables(call.layout),
            inputs: call.names.to_vec(),
            functions: call.scenario.functions.clone(),
            fields: call.scenario.fields.clone(),
        };
        self.kept.get(&names, || System::compile(self, &names)).map_err(|faults| {
            let lines = faults.into_iter().map(|(option, fault)| {
                // The option already names the definition.
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
        // If the equations are invalid, the check reports the cause; their inputs are then not reported as well.
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

    fn takes_fields(&self) -> bool {
        true
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

lacuna::register!(Model, "equations", Equations, aliases: ["ode", "odes"], revision = 3);
