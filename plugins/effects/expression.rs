//! `expression`: an effect written in the study.

use std::sync::OnceLock;

use lacuna::data::{Layout, Unit};
use lacuna::expression::{Evaluator, Fault, Program, Scope};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::effect::{Description, Situation, all, grid, propose, signs, spaced};
use lacuna::plugin::{Component, Context, Effect, Hyperparameter};
use lacuna::text::problem::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

/// A user-defined effect: a formula that is applied to each value of the response.
///
/// ```toml
/// [[effect]]
/// use = "expression"
/// name = "warming"
/// formula = "y * (1 - loss * exp(-t / time))"
/// parameters = [
///   { name = "loss", prior = { uniform = [0, 1] } },
///   { name = "time", unit = "s", prior = { log_uniform = [1e-5, 1e-3] } },
/// ]
/// ```
///
/// In the formula `y` is a value of the response in its unit, `t` its coordinate on the last axis (its time) in the
/// unit of that axis, and the other names are the effect's parameters. The language is that of all expressions in a
/// study; derivatives are exact.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Expression {
    /// Formula of the changed response, such as `"y + size * sin(2 * pi * frequency * t)"`.
    pub formula: String,
    /// Unknowns of the formula. The first is the size of the effect: if it has the value `absent`, the formula must
    /// equal `y` for all values of the others.
    pub parameters: Vec<Own>,
    /// Value of the first parameter at which the effect is absent.
    pub absent: f64,
    /// Title of the effect in plain words, for the report.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub title: String,
    #[serde(skip)]
    compiled: OnceLock<Option<Program>>,
}

/// An unknown of a formula.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Own {
    /// Name of the unknown in the formula.
    pub name: String,
    /// Prior distribution of the unknown, in `unit`.
    pub prior: Distribution,
    /// Unit of the unknown; the formula uses the number in this unit. Default: dimensionless.
    #[serde(default)]
    pub unit: Unit,
}

impl Default for Expression {
    fn default() -> Self {
        Self {
            formula: String::new(),
            parameters: Vec::new(),
            absent: 0.0,
            title: String::new(),
            compiled: OnceLock::new(),
        }
    }
}

/// The name under which the scope holds the formula.
const WHOLE: &str = "formula ";

impl Expression {
    fn compile(&self) -> Result<Program, Vec<Fault>> {
        let mut scope = Scope::new();
        let one = |fault: Fault| vec![fault];
        for name in ["y", "t"].into_iter().chain(self.parameters.iter().map(|p| p.name.as_str())) {
            scope.unknown(name).map_err(one)?;
        }
        scope.result(WHOLE, &self.formula).map_err(one)?;
        let program = scope.compile(&[WHOLE])?;
        if program.outputs() != 1 {
            let fault = Fault::new(0..self.formula.len(), "the formula is a vector");
            return Err(one(fault.expected("one number")));
        }
        Ok(program)
    }

    /// Compiled formula; `None` if it has errors, which the check reports.
    fn program(&self) -> Option<&Program> {
        self.compiled.get_or_init(|| self.compile().ok()).as_ref()
    }

    /// Calls `each` for every value of a response, with the formula evaluated there.
    fn walk(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        mut each: impl FnMut(usize, &mut Evaluator<'_>),
    ) -> Option<()> {
        let mut evaluator = Evaluator::new(self.program()?);
        let mut point = [&[0.0, 0.0], values].concat();
        for (i, (y, t)) in response.iter().zip(grid(layout).iter().cycle()).enumerate() {
            point[..2].copy_from_slice(&[*y, *t]);
            evaluator.at(&point);
            each(i, &mut evaluator);
        }
        Some(())
    }

    fn is_absent(&self, values: &[f64]) -> bool {
        values.first().is_none_or(|size| *size == self.absent)
    }

    /// Reports a formula that differs from `y` when the effect is absent.
    fn check_absent(&self, layout: &Layout, complaints: &mut Complaints<'_>) {
        let mut values: Vec<f64> = self.parameters.iter().map(|p| p.prior.quantile(0.4)).collect();
        values[0] = self.absent;
        let y = [-1.5, 0.5, 2.0][layout.len() % 3];
        let response = vec![y; layout.len()];
        let mut worst = 0.0_f64;
        let mut out = [0.0];
        self.walk(layout, &response, &values, |_, formula| {
            formula.values(&mut out);
            worst = if (out[0] - y).abs() <= worst { worst } else { (out[0] - y).abs() };
        });
        let vanishes = worst < 1e-9;
        if !vanishes {
            let name = &self.parameters[0].name;
            complaints
                .at("formula")
                .say(format!("with `{name}` = {} the formula is not `y`", self.absent))
                .help(
                    "the first parameter is the size of the effect: `absent` is its value without",
                )
                .help("write what is added or changed times the size, as in `y + size * exp(-t)`");
        }
    }
}

impl Component for Expression {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.formula.is_empty() {
            let problem = complaints.at("formula").say("missing key `formula`");
            problem.expected(
                "what becomes of a value `y` at `t`, such as `formula = \"y + size * t\"`",
            );
        }
        if self.parameters.is_empty() {
            let problem = complaints.at("parameters").say("missing key `parameters`");
            problem.expected(
                "its unknowns, such as `parameters = [{ name = \"size\", prior = { normal = [0, 1] } }]`",
            );
        }
        if self.formula.is_empty() || self.parameters.is_empty() {
            return;
        }
        match self.compile() {
            Ok(_) => self.check_absent(context.layout, complaints),
            Err(faults) => {
                for fault in faults {
                    let problem = complaints.at("formula").inside(fault.span).say(fault.message);
                    problem.expected = fault.expected.map(String::from);
                    problem.found = fault.found.map(String::from);
                    problem.help.extend(fault.help.map(String::from));
                }
            }
        }
        let (low, high) = self.parameters[0].prior.support();
        if !(low..=high).contains(&self.absent) {
            let name = &self.parameters[0].name;
            complaints
                .at("absent")
                .say(format!("the prior of `{name}` leaves out {}", self.absent))
                .help(format!("`absent` is the value of `{name}` without the effect"));
        }
    }
}

impl Effect for Expression {
    fn describe(&self) -> Description {
        let own = if self.title.is_empty() { "a formula of the study" } else { &self.title };
        let formula = if self.formula.is_empty() { "as written" } else { &self.formula };
        Description { title: own.into(), formula: formula.into(), source: "the study".into() }
    }

    fn parameters(&self, _: &Layout) -> Vec<Hyperparameter> {
        let parameter = |own: &Own| Hyperparameter {
            name: own.name.clone(),
            symbol: own.name.clone(),
            unit: own.unit.clone(),
            prior: own.prior.clone(),
            log: matches!(own.prior, Distribution::LogNormal(_) | Distribution::LogUniform(_)),
            start: own.prior.quantile(0.5),
        };
        self.parameters.iter().map(parameter).collect()
    }

    fn absent(&self, _: &Layout) -> Vec<f64> {
        let mut values: Vec<f64> = self.parameters.iter().map(|p| p.prior.quantile(0.5)).collect();
        values.iter_mut().take(1).for_each(|size| *size = self.absent);
        values
    }

    fn apply(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Vec<f64> {
        let mut out = response.to_vec();
        if !self.is_absent(values) {
            self.walk(layout, response, values, |i, formula| formula.values(&mut out[i..=i]));
        }
        out
    }

    fn by_parameters(&self, layout: &Layout, response: &[f64], values: &[f64]) -> Matrix {
        let mut jacobian = Matrix::zeros(response.len(), values.len());
        let mut direction = vec![0.0; values.len() + 2];
        self.walk(layout, response, values, |i, formula| {
            for (j, slope) in jacobian.row_mut(i).iter_mut().enumerate() {
                direction[j + 2] = 1.0;
                formula.slopes(&direction, std::slice::from_mut(slope));
                direction[j + 2] = 0.0;
            }
        });
        jacobian
    }

    fn push_forward(
        &self,
        layout: &Layout,
        response: &[f64],
        values: &[f64],
        tangent: &[f64],
    ) -> Vec<f64> {
        let mut out = tangent.to_vec();
        if self.is_absent(values) {
            return out;
        }
        let mut direction = vec![0.0; values.len() + 2];
        self.walk(layout, response, values, |i, formula| {
            direction[0] = tangent[i];
            formula.slopes(&direction, &mut out[i..=i]);
        });
        out
    }

    fn starts(&self, _: &Layout, _: &Situation<'_>) -> Vec<Vec<f64>> {
        let Some((size, indices)) = self.parameters.split_first() else { return Vec::new() };
        // Nothing is known of the modes: some ninety combinations of the indices.
        let each = 90_f64.powf(1.0 / indices.len().max(1) as f64).floor().max(1.0) as usize;
        let mut columns = vec![signs(Some(&size.prior), self.absent)];
        let whole = (f64::NEG_INFINITY, f64::INFINITY);
        columns.extend(indices.iter().map(|own| spaced(Some(&own.prior), whole, each.min(30))));
        all(&columns)
    }

    /// The effect itself, if the study gives it a formula.
    fn proposals(&self, _: &Situation<'_>) -> Vec<Table> {
        if self.formula.is_empty() || self.parameters.is_empty() {
            return Vec::new();
        }
        let own = |own: &Own| {
            let mut table = propose(&[("prior", own.prior.clone())]);
            table.insert("name".to_owned(), Value::String(own.name.clone()));
            table.insert("unit".to_owned(), Value::String(own.unit.to_string()));
            Value::Table(table)
        };
        let mut table = Table::new();
        table.insert("formula".to_owned(), Value::String(self.formula.clone()));
        table.insert("title".to_owned(), Value::String(self.title.clone()));
        table.insert("absent".to_owned(), Value::Float(self.absent));
        let parameters = self.parameters.iter().map(own).collect();
        table.insert("parameters".to_owned(), Value::Array(parameters));
        vec![table]
    }
}

lacuna::register!(Effect, "expression", Expression);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{curve, effect, even};

    /// An effect written as a formula and the plugin of the same effect.
    #[test]
    fn a_formula_is_the_plugin_of_that_formula() {
        let formula = "formula = \"y + size * exp(-t / decay)\"\nparameters = [\n\
                       { name = \"size\", prior = { normal = [0, 1] } },\n\
                       { name = \"decay\", unit = \"s\", prior = { half_normal = 1 } }]";
        let plugin = "amplitude = { normal = [0, 1] }\ndecay = { half_normal = 1 }";
        let (written, plugin) = (effect("expression", formula), effect("flash", plugin));
        let (layout, response) = (curve(even(9, 0.3)), [0.7; 9]);
        for values in [[0.5, 0.8], [-2.0, 0.1], [0.0, 1.0]] {
            let pairs = [
                (
                    written.apply(&layout, &response, &values),
                    plugin.apply(&layout, &response, &values),
                ),
                (
                    written.by_parameters(&layout, &response, &values).into_vec(),
                    plugin.by_parameters(&layout, &response, &values).into_vec(),
                ),
            ];
            for (written, plugin) in pairs {
                assert!(written.iter().zip(&plugin).all(|(a, b)| (a - b).abs() < 1e-14));
            }
        }
    }
}
