//! `expression`: a log density written in the study.

mod data;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use lacuna::data::Parameter;
use lacuna::expression::{Fault, Program, Scope};
use lacuna::plugin::density::{BoundDensity, Density};
use lacuna::plugin::{Component, Context, Fact};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use lacuna_linalg::Matrix;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use data::Known;

/// A log density written as an expression of the study's parameters.
///
/// ```toml
/// [study]
/// title = "A straight line"
///
/// [[parameter]]
/// name = "intercept"
/// prior = { normal = [0.0, 10.0] }
///
/// [[parameter]]
/// name = "slope"
/// prior = { normal = [0.0, 10.0] }
///
/// [[parameter]]
/// name = "sigma"
/// prior = { half_normal = 1.0 }
///
/// [target]
/// use = "expression"
/// log_density = "sum(normal_log_density(y, line, sigma))"
/// where = { line = "intercept + slope * x" }
/// data = { x = [0.0, 1.0, 2.0], y = [0.9, 3.1, 5.0] }
///
/// [sampler]
/// use = "no_u_turn"
/// ```
///
/// An expression may use the usual operators and functions (`+ - * / ^`, comparisons, `and`, `or`, `not`,
/// `if(condition, yes, no)`, `exp`, `log`, `sqrt`, trigonometry, `erf`, `log_gamma`, …) and log densities
/// (`normal_log_density(x, mean, sd)`, and likewise `log_normal`, `student_t`, `cauchy`, `exponential`, `gamma`,
/// `inverse_gamma`, `beta`, `uniform`, `poisson`, `binomial`, with the arguments of the priors of that name). Vectors
/// are combined element by element; `sum`, `mean`, `min`, `max`, `dot` and `log_sum_exp` reduce them to one number;
/// `recurrence(start, factor, input)` is the vector of `z[i] = factor * z[i - 1] + input[i]`, for time series.
/// Indices start at 1: `y[3]`, `y[2:10]`, `theta[school]` for a vector of whole numbers; `[a, b, c]` makes a vector.
///
/// The posterior is the prior times the density, which is zero where the expression is undefined. The gradient is
/// exact; the module `lacuna::expression` says which slope is taken at a kink.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expression {
    /// Logarithm of the density, up to a constant: an expression of the parameters, the definitions and the data.
    pub log_density: String,
    /// Definitions: names for expressions (numbers or vectors) that other expressions use. Their order does not
    /// matter.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub definitions: BTreeMap<String, String>,
    /// Data: numbers, lists of numbers (vectors), or lists of rows (matrices, for `matrix_product(matrix, vector)`).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub data: BTreeMap<String, Known>,
    /// If true, the expression is the whole posterior density; the prior then only provides starting points and
    /// bounds, and every parameter must occur in the expression. If false, the expression is multiplied by the prior.
    #[serde(default)]
    pub includes_prior: bool,
}

/// Name of the expression itself in the scope.
const WHOLE: &str = "log_density";

impl Expression {
    /// Compiles the expression; on failure returns all faults, each with the option that contains it.
    fn compile(&self, parameters: &[Parameter]) -> Result<Program, Vec<(String, Fault)>> {
        let mut scope = Scope::new();
        let mut faults = Vec::new();
        let mut note = |option: &str, outcome: Result<(), Fault>| {
            faults.extend(outcome.err().map(|fault| (option.to_owned(), fault)));
        };
        for parameter in parameters {
            note(WHOLE, scope.unknown(&parameter.name));
        }
        for (name, known) in &self.data {
            note(&format!("data.{name}"), scope.data(name, known.0.clone()));
        }
        for (name, text) in &self.definitions {
            note(&format!("where.{name}"), scope.define(name, text));
        }
        note(WHOLE, scope.define(WHOLE, &self.log_density));
        if !faults.is_empty() {
            return Err(faults);
        }
        let located = |fault: Fault| {
            let option = match fault.definition.as_str() {
                "" | WHOLE => WHOLE.to_owned(),
                definition => format!("where.{definition}"),
            };
            (option, fault)
        };
        let program = scope.compile(&[WHOLE]);
        let program =
            program.map_err(|faults| faults.into_iter().map(located).collect::<Vec<_>>())?;
        self.suits(&program, parameters).map_err(|fault| vec![(WHOLE.to_owned(), fault)])?;
        Ok(program)
    }

    /// Checks that the result is one number and, without a prior, depends on every parameter.
    fn suits(&self, program: &Program, parameters: &[Parameter]) -> Result<(), Fault> {
        let whole = 0..self.log_density.len();
        if program.outputs() != 1 {
            return Err(Fault::new(whole, "the log density is a vector")
                .expected("one number")
                .found(format!("{} numbers", program.outputs()))
                .help("`sum(…)` adds the elements"));
        }
        let absent = parameters.iter().enumerate().find(|(i, _)| !program.depends_on(*i));
        match absent {
            Some((_, parameter)) if self.includes_prior => {
                let message = format!("the log density does not depend on `{}`", parameter.name);
                Err(Fault::new(whole, message)
                    .help("with `includes_prior = true` nothing else says where it is"))
            }
            _ => Ok(()),
        }
    }
}

impl Component for Expression {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let Err(faults) = self.compile(context.parameters) else { return };
        for (option, fault) in faults {
            let problem = complaints.at(&option).inside(fault.span).say(fault.message);
            problem.expected = fault.expected.map(String::from);
            problem.found = fault.found.map(String::from);
            problem.help.extend(fault.help.map(String::from));
        }
    }
}

impl Density for Expression {
    fn bind(&self, parameters: &[Parameter]) -> Result<Box<dyn BoundDensity>, Stop> {
        let program = self.compile(parameters).map_err(|faults| {
            let lines = faults.iter().map(|(option, fault)| {
                // The option already names the definition.
                let fault = Fault { definition: String::new(), ..fault.clone() };
                format!("`target.{option}`: {fault}")
            });
            Stop::new(lines.collect::<Vec<_>>().join("\n"))
        })?;
        Ok(Box::new(Bound { program }))
    }

    fn includes_prior(&self) -> bool {
        self.includes_prior
    }
}

struct Bound {
    program: Program,
}

/// Number of operations below which a batch is evaluated on one thread.
const SHARED: usize = 200_000;

/// Number of points that one thread takes at a time.
const CHUNK: usize = 64;

impl Bound {
    fn chunk(&self, points: &Matrix) -> Vec<f64> {
        self.program.values(points).into_vec().into_iter().map(defined).collect()
    }
}

impl BoundDensity for Bound {
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        if points.rows() * self.program.operations() < SHARED {
            return self.chunk(points);
        }
        let indices: Vec<usize> = (0..points.rows()).collect();
        let chunks: Vec<Vec<f64>> =
            indices.par_chunks(CHUNK).map(|rows| self.chunk(&points.select_rows(rows))).collect();
        chunks.concat()
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let (value, gradient) = self.program.gradient(point);
        let value = defined(value);
        if value.is_infinite() { (value, vec![0.0; point.len()]) } else { (value, gradient) }
    }

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::new("operations of the log density", self.program.operations())]
    }
}

/// Replaces an undefined or infinite log density by minus infinity, i.e. zero density.
fn defined(log_density: f64) -> f64 {
    if log_density < f64::INFINITY { log_density } else { f64::NEG_INFINITY }
}

lacuna::register!(Density, "expression", Expression);
