//! `[[gap.next]]` and `[gap.quantity]`: data that could be taken next, and a quantity that they should tell.

use std::collections::BTreeMap;

use lacuna::plugin::effect::On;
use lacuna::text::values::{Count, Fraction, Interval, Name, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Data that could be taken next, which `lacuna next STUDY` weighs against the others: further measurements, further runs of
/// the simulator, or a finer mesh.
///
/// Measurements are chosen by `scenarios`, `on` and `along`, also where nothing was measured so far: a scenario, a sensor or
/// a stretch of the last axis that the study describes and that has no data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NextKeys {
    /// Name in the results. Default: what is taken, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<Name>,
    /// Scenarios that are measured, by name. Default: those that have measurements.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scenarios: Vec<String>,
    /// Curves that are measured, by their labels, such as `{ sensor = ["B"] }`. Default: those that have measurements in some
    /// scenario.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub on: On,
    /// Intervals of the last axis that are measured, in the unit of the axis. Default: where there are measurements; the
    /// whole axis of a curve without any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub along: Vec<Interval>,
    /// Number of replicates.
    pub replicates: Count,
    /// Standard deviation of the noise of a single value, in the unit of the response. Default: the noise of the same
    /// curve; of a curve without measurements that of the same sensor in another scenario, or else what `noise` in
    /// `[measurements]` states, or else the mean of all curves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<Positive>,
    /// Number of further runs of the simulator for the surrogate, in place of measurements. Its error is then taken to fall
    /// with the square root of the number of runs, if `emulator_error` does not say otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs: Option<Count>,
    /// Factor by which the error of the surrogate becomes smaller, in place of measurements: 0.5 for half of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emulator_error: Option<Fraction>,
    /// Factor by which the error of the mesh (`[numerical_error]`) becomes smaller, in place of measurements: 0.25 for cells of
    /// half the size and a method of second order.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub numerical_error: Option<Fraction>,
    /// Cost, in a unit that all options share; options are ranked by the bits per cost. Default for measurements: one for
    /// each scenario and replicate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<Positive>,
}

impl Default for NextKeys {
    fn default() -> Self {
        Self {
            name: None,
            scenarios: Vec::new(),
            on: On::new(),
            along: Vec::new(),
            replicates: Count::new(1).unwrap_or_else(|_| unreachable!("1 is a count")),
            noise: None,
            runs: None,
            emulator_error: None,
            numerical_error: None,
            cost: None,
        }
    }
}

impl NextKeys {
    /// Returns true if the option computes something in place of measuring.
    pub fn is_computed(&self) -> bool {
        self.runs.is_some() || self.emulator_error.is_some() || self.numerical_error.is_some()
    }
}

/// How the values of a quantity are reduced to one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reduction {
    /// Their mean.
    #[default]
    Mean,
    /// The largest of them.
    Largest,
    /// The smallest of them.
    Smallest,
    /// The largest less the smallest.
    Range,
}

/// A quantity of the response that the next data should tell: `lacuna next STUDY` states the expected bits on it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct QuantityKeys {
    /// Scenarios, by name, with measurements or without. Default: all.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scenarios: Vec<String>,
    /// Curves, by their labels, such as `{ sensor = ["B"] }`. Default: all.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub on: On,
    /// Intervals of the last axis, in its unit. Default: the whole axis.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub along: Vec<Interval>,
    /// The number that the values there are reduced to: `"mean"`, `"largest"`, `"smallest"` or `"range"` (largest less
    /// smallest).
    pub of: Reduction,
}
