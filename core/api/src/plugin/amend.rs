//! Models to whose equations a study can add terms.

use lacuna_base::data::Unit;
use lacuna_base::expression::Fault;
use toml::{Table, Value};

use super::Context;
use super::model::{Call, EvalError};

/// A model whose equations can be extended by terms.
pub trait Amend: Send + Sync {
    /// States to whose rates terms can be added.
    fn states(&self, context: &Context<'_>) -> Vec<State>;

    /// Unit of an expression of states, inputs, definitions and the time, with further states; `None` for zero, which
    /// is compatible with every unit.
    fn unit(
        &self,
        context: &Context<'_>,
        expression: &str,
        further: &[State],
    ) -> Result<Option<Unit>, Fault>;

    /// Values of each expression along a run, at the places of the response's numeric axes.
    fn along(&self, call: &Call<'_>, expressions: &[String]) -> Result<Vec<Vec<f64>>, EvalError>;

    /// Root mean square of each expression along a run.
    fn sizes(&self, call: &Call<'_>, expressions: &[String]) -> Result<Vec<f64>, EvalError> {
        let square = |part: &Vec<f64>| part.iter().map(|x| x * x).sum::<f64>() / part.len() as f64;
        let values = self.along(call, expressions)?;
        Ok(values.iter().map(|part| square(part).sqrt()).collect())
    }

    /// Inputs that are coefficients of summands of rates and nothing else: at zero the summand is absent.
    fn factors(&self, context: &Context<'_>) -> Vec<String>;

    /// Options that change when these terms are added: paths of keys and their new values.
    fn amended(&self, additions: &[Addition]) -> Vec<Change>;
}

/// A state variable of a model.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// Name of the state in expressions.
    pub name: String,
    /// Unit of the state.
    pub unit: Unit,
    /// Unit of its rate; `None` if that is not expressible as a unit.
    pub rate_unit: Option<Unit>,
    /// Rate of the state, as an expression.
    pub rate: String,
    /// States on which the rate depends.
    pub uses: Vec<String>,
    /// Initial value, as an expression of the model's inputs.
    pub start: String,
    /// Quantities of which the rate has the difference to a state: the state, and the expression, such as `x` and
    /// `ambient` in `loss * (ambient - x)`.
    pub references: Vec<[String; 2]>,
    /// Parts of the rate that depend on the time and on no state, such as `force(t)`, with their units.
    pub inputs: Vec<(String, Unit)>,
}

/// Terms that are added to equations.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Addition {
    /// States with the expression that is added to their rates.
    pub summands: Vec<(String, String)>,
    /// Further states.
    pub states: Vec<State>,
}

/// A changed option of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Keys that lead to the option from the model's section.
    pub path: Vec<String>,
    /// New value.
    pub value: Value,
}

/// Options with the changes applied.
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
