//! `[[predict]]`: conditions under which the response is only predicted.

use std::collections::BTreeMap;

use lacuna::text::node::{Key, Node};
use lacuna::text::response::Axes;
use lacuna::text::{Problems, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file::{FunctionSection, Quantity};

/// Conditions under which nothing was measured and the response is predicted, such as twice the beam power: short for a
/// `[[scenario]]` with `measured = false`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PredictSection {
    /// Name of the conditions; the quantities predicted there are called `peak[name]`.
    pub name: String,
    /// Groups to which the conditions belong, as in `[[scenario]]`. A group without measurements is a new member of the
    /// populations: its parameters are drawn from them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub labels: BTreeMap<String, String>,
    /// Known values. A value with the name of an input of the model sets this input; expressions may use all of them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, Quantity>,
    /// Known functions of one variable, tabulated in CSV files, as in `[[scenario]]`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub functions: BTreeMap<String, FunctionSection>,
    /// Axes of the response under these conditions, as in `[[scenario]]`.
    #[serde(default)]
    pub axes: Axes,
}

/// Makes each `[[predict]]` of a study a `[[scenario]]` without measurements.
pub(super) fn as_scenarios(root: &mut Node, problems: &mut Problems) {
    let Some((key, predicted)) = root.remove("predict") else { return };
    let Value::Array(predicted_list) = predicted.value else {
        problems.report(Some(key.place), "`predict` is a list").expected("`[[predict]]`");
        return;
    };
    if root.get("measurements").is_some() && root.get("scenario").is_none() {
        problems
            .report(Some(key.place.clone()), "the measured conditions have no name")
            .expected("a `[[scenario]]` with the conditions of the measurements");
        return;
    }
    let mut all = match root.remove("scenario").map(|(_, node)| node.value) {
        Some(Value::Array(scenarios)) => scenarios,
        _ => Vec::new(),
    };
    for mut node in predicted_list {
        if let Some(measured) = node.get("measured") {
            problems
                .report(
                    Some(measured.place.clone()),
                    "nothing is measured under conditions that are predicted",
                )
                .help("conditions with measurements are a `[[scenario]]`");
            continue;
        }
        let place = node.place.clone();
        let measured = Node { value: Value::Boolean(false), place: place.clone() };
        node.set(Key { name: "measured".to_owned(), place }, measured);
        all.push(node);
    }
    let scenarios = Node { value: Value::Array(all), place: predicted.place };
    root.set(Key { name: "scenario".to_owned(), place: key.place }, scenarios);
}
