//! Known conditions of a run.

use std::collections::BTreeMap;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Field, Unit};

/// Known conditions under which a response is simulated or measured, such as a beam power.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// Name of the scenario; empty in a study with one set of conditions.
    pub name: String,
    /// Groups to which it belongs, by label: `target`, `batch`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub labels: BTreeMap<String, String>,
    /// Named constants.
    pub values: Vec<Condition>,
    /// Named functions of one variable, such as a measured force over time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub functions: Vec<Arc<Function>>,
    /// Random fields, the same under all conditions of a study.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fields: Vec<Arc<Field>>,
    /// True if nothing was measured under these conditions.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub unmeasured: bool,
}

/// A known constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// Name, such as `beam_power`.
    pub name: String,
    /// The value, in `unit`.
    pub value: f64,
    /// Unit of the value; `None` for a number in the unit of the input that it sets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
}

/// A function of one variable given by a table; beyond its nodes it has the value of the nearest one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Function {
    /// Name, such as `force`.
    pub name: String,
    /// Nodes: values of the variable, strictly increasing.
    pub at: Vec<f64>,
    /// Unit of the variable.
    pub at_unit: Unit,
    /// Value of the function at each node.
    pub values: Vec<f64>,
    /// Unit of the function's values.
    pub unit: Unit,
    /// The function between two nodes.
    #[serde(default, skip_serializing_if = "Interpolation::is_linear")]
    pub interpolation: Interpolation,
}

/// A function between the nodes of its table.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// A straight line from node to node.
    #[default]
    Linear,
    /// The value of the last node, as of a converter that holds its output until the next sample.
    Hold,
    /// A cubic spline through the nodes with continuous curvature: for samples of a smooth signal.
    Spline,
}

impl Interpolation {
    /// True for a straight line.
    #[allow(clippy::trivially_copy_pass_by_ref)] // Serde passes a reference.
    pub fn is_linear(&self) -> bool {
        *self == Self::Linear
    }
}

impl Scenario {
    /// Name of the scenario; `None` if it is empty.
    pub fn label(&self) -> Option<&str> {
        (!self.name.is_empty()).then_some(&self.name)
    }

    /// The constant with this name.
    pub fn value(&self, name: &str) -> Option<&Condition> {
        self.values.iter().find(|condition| condition.name == name)
    }

    /// The function with this name.
    pub fn function(&self, name: &str) -> Option<&Function> {
        self.functions.iter().map(AsRef::as_ref).find(|function| function.name == name)
    }
}
