//! Equations with resolved names: programs for the start, the rates and the observed quantities.

use std::sync::Arc;

use lacuna::data::{Axis, Coordinates, Field, Function, Layout};
use lacuna::expression::{Break, Evaluator, Fault, Program, Scope, is_name};
use lacuna::plugin::{Context, Given};

use super::Equations;

/// Names that equations may use in addition to their own.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Names {
    /// Numeric axes of the response.
    pub variables: Vec<String>,
    /// Inputs given by the study.
    pub inputs: Vec<String>,
    /// Tables that are called as functions.
    pub functions: Vec<Arc<Function>>,
    /// Random fields that are called as functions; their coefficients are inputs.
    pub fields: Vec<Arc<Field>>,
}

/// Name of the option for the start time.
pub const START_TIME: &str = "start_time";

/// Number of points at which rates are tested for linearity.
const POINTS: usize = 5;

/// A fault and the option that contains it.
pub type Located = (String, Fault);

/// Compiled equations. A point holds the variables, the inputs and the states, in this order.
#[derive(Debug)]
pub struct System {
    /// Names of the variables; the only one of a system with states is its time.
    pub variables: Vec<String>,
    /// Names of the states.
    pub states: Vec<String>,
    /// Number of inputs.
    pub inputs: usize,
    /// Start time and initial value of each state; functions of the inputs only.
    pub start: Program,
    /// Rate of each state.
    pub rates: Program,
    /// Observed quantities, one per label.
    pub observed: Program,
    /// Labels; a single empty one for a response without labels.
    pub labels: Vec<String>,
    /// Discontinuities of the rates.
    pub breaks: Vec<Break>,
}

impl Names {
    /// Returns the names of a layout's numeric axes.
    pub fn variables(layout: &Layout) -> Vec<String> {
        let grid = |axis: &&Axis| matches!(axis.coordinates, Coordinates::Grid { .. });
        layout.axes.iter().filter(grid).map(|axis| axis.name.clone()).collect()
    }

    /// Returns the names of a study. A name that cannot be written in an expression is left out.
    pub fn of(context: &Context<'_>) -> Self {
        let scenario = context.scenarios.first();
        let fields = scenario.map(|scenario| scenario.fields.clone()).unwrap_or_default();
        let coefficients: Vec<String> = fields.iter().flat_map(|f| f.coefficients()).collect();
        let mut inputs: Vec<String> = Vec::new();
        for Given { name, .. } in context.given {
            let usable = is_name(name) || coefficients.contains(name);
            if usable && !inputs.contains(name) {
                inputs.push(name.clone());
            }
        }
        Self {
            variables: Self::variables(context.layout),
            inputs,
            functions: scenario.map(|scenario| scenario.functions.clone()).unwrap_or_default(),
            fields,
        }
    }
}

/// Builds the scope of the equations; on failure returns all faults of their form.
pub fn scope(equations: &Equations, names: &Names) -> Result<Scope, Vec<Located>> {
    let mut scope = Scope::new();
    let mut faults = Vec::new();
    let mut note = |option: String, outcome: Result<(), Fault>| {
        faults.extend(outcome.err().map(|fault| (option, fault)));
    };
    for field in &names.fields {
        note(String::new(), scope.field(field.clone()));
    }
    for name in names.variables.iter().chain(&names.inputs) {
        note(String::new(), scope.unknown(name));
    }
    for function in &names.functions {
        note(String::new(), scope.function(function.clone()));
    }
    for name in equations.state.keys() {
        note(format!("state.{name}"), scope.unknown(name));
    }
    for (name, text) in &equations.definitions {
        note(format!("where.{name}"), scope.define(name, text));
    }
    note(START_TIME.into(), scope.result(&key(START_TIME), &equations.start_time.text()));
    for (name, state) in &equations.state {
        let (start, part) = state.start();
        let option = format!("state.{name}{part}");
        note(option.clone(), scope.result(&key(&option), &start.text()));
    }
    for (name, text) in &equations.rate {
        let option = format!("rate.{name}");
        note(option.clone(), scope.result(&key(&option), text));
    }
    for (_, option, text) in equations.observe.each() {
        note(option.clone(), scope.result(&key(&option), text));
    }
    faults.extend(states_without_rates(equations));
    if faults.is_empty() { Ok(scope) } else { Err(faults) }
}

fn states_without_rates(equations: &Equations) -> Vec<Located> {
    let (states, rates) = (&equations.state, &equations.rate);
    let listed = states.keys().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    let missing = states.keys().filter(|name| !rates.contains_key(*name)).map(|name| {
        let fault = Fault::new(0..0, format!("the state `{name}` has no rate"));
        (format!("state.{name}"), fault.help(format!("add `{name} = \"…\"` to `rate`")))
    });
    let surplus = rates.keys().filter(|name| !states.contains_key(*name)).map(|name| {
        let fault = Fault::new(0..0, format!("there is no state `{name}`"));
        let fault = if states.is_empty() {
            fault.help("states are declared in `state`, with their start values")
        } else {
            fault.expected(format!("one of {listed}"))
        };
        (format!("rate.{name}"), fault)
    });
    missing.chain(surplus).collect()
}

impl System {
    /// Compiles the equations; on failure returns all faults.
    pub fn compile(equations: &Equations, names: &Names) -> Result<Self, Vec<Located>> {
        let scope = scope(equations, names)?;
        let states: Vec<String> = equations.state.keys().cloned().collect();
        let rates: Vec<String> = states.iter().map(|name| format!("rate.{name}")).collect();
        let observed = equations.observe.each();
        let options: Vec<String> = observed.iter().map(|(_, option, _)| option.clone()).collect();
        let rates = program(&scope, &rates)?;
        let system = Self {
            start: program(&scope, &equations.starts())?,
            observed: program(&scope, &options)?,
            breaks: rates.breaks(),
            rates,
            labels: observed.into_iter().map(|(label, ..)| label.to_owned()).collect(),
            variables: names.variables.clone(),
            inputs: names.inputs.len(),
            states,
        };
        system.start_is_of_inputs(equations, names, &scope)?;
        Ok(system)
    }

    /// Returns true if any expression uses this input.
    pub fn uses(&self, input: usize) -> bool {
        let coordinate = self.variables.len() + input;
        [&self.start, &self.rates, &self.observed].iter().any(|p| p.depends_on(coordinate))
    }

    /// Returns true if the states depend on this input.
    pub fn moves_states(&self, input: usize) -> bool {
        let coordinate = self.variables.len() + input;
        self.start.depends_on(coordinate) || self.rates.depends_on(coordinate)
    }

    /// Returns true if the rates are linear in this input, and nothing else depends on it.
    pub fn is_factor(&self, input: usize) -> bool {
        let coordinate = self.variables.len() + input;
        let elsewhere = [&self.start, &self.observed].iter().any(|p| p.depends_on(coordinate));
        !elsewhere && self.rates.depends_on(coordinate) && self.are_linear_in(coordinate)
    }

    /// Returns true if, at several points, the rates with the coordinate at 0, 1 and 2 lie on straight lines.
    fn are_linear_in(&self, coordinate: usize) -> bool {
        let mut rates = Evaluator::new(&self.rates);
        let mut at = |point: &[f64]| {
            let mut row = vec![0.0; self.states.len()];
            rates.at(point);
            rates.values(&mut row);
            row
        };
        (1..=POINTS).all(|k| {
            // Any unrelated numbers of ordinary size serve as test points.
            let number = |i: usize| 0.5 + (0.618_034 * (i + 1) as f64 * k as f64).fract();
            let mut point: Vec<f64> = (0..self.coordinates()).map(number).collect();
            let [none, one, two] = [0.0, 1.0, 2.0].map(|x| {
                point[coordinate] = x;
                at(&point)
            });
            none.iter().zip(&one).zip(&two).all(|((none, one), two)| {
                let size = none.abs().max(one.abs()).max(two.abs());
                (none - 2.0 * one + two).abs() <= 1e-9 * size
            })
        })
    }

    /// Returns the number of coordinates of a point.
    pub fn coordinates(&self) -> usize {
        self.variables.len() + self.inputs + self.states.len()
    }

    /// Fails if an initial value depends on a variable or a state, which are known only after the start.
    fn start_is_of_inputs(
        &self,
        equations: &Equations,
        names: &Names,
        scope: &Scope,
    ) -> Result<(), Vec<Located>> {
        let inputs = self.variables.len()..self.variables.len() + self.inputs;
        let later = (0..self.coordinates()).filter(|i| !inputs.contains(i));
        let mut faults = Vec::new();
        for coordinate in later.filter(|i| self.start.depends_on(*i)) {
            let name = match coordinate.checked_sub(inputs.end) {
                Some(state) => &self.states[state],
                None => &names.variables[coordinate],
            };
            for option in equations.starts() {
                if program(scope, std::slice::from_ref(&option))?.depends_on(coordinate) {
                    let fault = Fault::new(0..0, format!("the start depends on `{name}`"))
                        .expected("an expression of parameters and other inputs");
                    faults.push((option, fault));
                }
            }
        }
        if faults.is_empty() { Ok(()) } else { Err(faults) }
    }
}

/// Compiles these results; fails if one of them is not a single number.
pub fn program(scope: &Scope, results: &[String]) -> Result<Program, Vec<Located>> {
    let keys: Vec<String> = results.iter().map(|option| key(option)).collect();
    let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
    let program = scope.compile(&keys).map_err(|faults| {
        let located = |fault: Fault| (option_of(&fault.definition), fault);
        faults.into_iter().map(located).collect::<Vec<_>>()
    })?;
    let lengths = program.lengths();
    let vectors = results.iter().zip(lengths).filter(|(_, length)| *length != 1);
    let faults: Vec<Located> = vectors
        .map(|(option, length)| {
            let fault = Fault::new(0..0, "this is a vector").expected("one number");
            (option.clone(), fault.found(format!("{length} numbers")))
        })
        .collect();
    if faults.is_empty() { Ok(program) } else { Err(faults) }
}

/// Returns the key of the result of an option. It is not a valid name, so that no expression can use it.
pub fn key(option: &str) -> String {
    format!("={option}")
}

/// Returns the option that contains a definition.
pub fn option_of(definition: &str) -> String {
    match definition.strip_prefix('=') {
        Some(option) => option.to_owned(),
        None => format!("where.{definition}"),
    }
}
