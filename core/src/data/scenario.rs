//! Known conditions of a run.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Unit;

/// Known conditions under which a response is simulated or measured, such as a beam power.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// The scenario's name; empty in a study with one set of conditions.
    pub name: String,
    /// Named values.
    pub values: Vec<Condition>,
    /// Named functions of one variable, such as a measured force over time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub functions: Vec<Arc<Function>>,
}

/// A known value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// Its name, such as `beam_power`.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Its unit; `None` for a plain number in the unit of whatever it sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
}

/// A function of one variable given by a table: linear between its points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Function {
    /// Its name, such as `force`.
    pub name: String,
    /// The values of the variable, increasing.
    pub at: Vec<f64>,
    /// The unit of the variable.
    pub at_unit: Unit,
    /// The function's value at each of them.
    pub values: Vec<f64>,
    /// The unit of the values.
    pub unit: Unit,
}

impl Scenario {
    /// Its name, where it has one.
    pub fn label(&self) -> Option<&str> {
        (!self.name.is_empty()).then_some(&self.name)
    }

    /// The value of this name.
    pub fn value(&self, name: &str) -> Option<&Condition> {
        self.values.iter().find(|condition| condition.name == name)
    }

    /// The function of this name.
    pub fn function(&self, name: &str) -> Option<&Function> {
        self.functions.iter().map(AsRef::as_ref).find(|function| function.name == name)
    }
}
