//! Models to which a study can add terms: their equations as text.

use toml::{Table, Value};

use super::Context;
use super::model::{Call, EvalError};
use crate::data::Unit;
use crate::expression::Fault;

/// A model whose equations can have further terms.
pub trait Amend: Send + Sync {
    /// The states to whose rates terms can be added.
    fn states(&self, context: &Context<'_>) -> Vec<State>;

    /// The unit of an expression of states, inputs, definitions and the time, with further states; `None` for what
    /// is zero and has every unit.
    fn unit(
        &self,
        context: &Context<'_>,
        expression: &str,
        further: &[State],
    ) -> Result<Option<Unit>, Fault>;

    /// The root mean squares of expressions along a run.
    fn sizes(&self, call: &Call<'_>, expressions: &[String]) -> Result<Vec<f64>, EvalError>;

    /// The inputs that are coefficients of summands of rates and nothing else: at zero the summand is absent.
    fn factors(&self, context: &Context<'_>) -> Vec<String>;

    /// The options that become others when these terms are added: paths of keys and their new values.
    fn amended(&self, additions: &[Addition]) -> Vec<Change>;
}

/// A state of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Its name in expressions.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// The unit of its rate; `None` where no unit is that.
    pub rate_unit: Option<Unit>,
    /// Its rate, as an expression.
    pub rate: String,
    /// The states on which its rate depends.
    pub uses: Vec<String>,
    /// Its start, as an expression of the model's inputs.
    pub start: String,
}

/// What is added to equations.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Addition {
    /// States with what is added to their rates.
    pub summands: Vec<(String, String)>,
    /// Further states.
    pub states: Vec<State>,
}

/// An option of a model that becomes another.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// The keys that lead to it from the model's section.
    pub path: Vec<String>,
    /// What it becomes.
    pub value: Value,
}

/// Options with changes made.
pub fn changed(options: &Table, changes: &[Change]) -> Table {
    let mut whole = options.clone();
    for change in changes {
        set(&mut whole, &change.path, &change.value);
    }
    whole
}

fn set(table: &mut Table, path: &[String], value: &Value) {
    match path {
        [] => {}
        [key] => {
            table.insert(key.clone(), value.clone());
        }
        [key, rest @ ..] => {
            let mut inner = match table.get(key) {
                Some(Value::Table(inner)) => inner.clone(),
                _ => Table::new(),
            };
            set(&mut inner, rest, value);
            table.insert(key.clone(), inner.into());
        }
    }
}
