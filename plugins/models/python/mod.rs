//! `python`: a function in a Python file as a simulator.

mod check;
mod frame;
mod pool;
mod worker;
mod written;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lacuna::data::Unit;
use lacuna::plugin::model::{Call, EvalError, Gradient, Response, Signature};
use lacuna::plugin::{Component, Context, Model};
use lacuna::text::problem::Complaints;
use lacuna::text::values::{Count, Positive};
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::pool::Pool;
use super::given;

/// Calls a function in a Python file.
///
/// ```toml
/// [model]
/// use = "python"
/// file = "oscillator.py"
/// function = "simulate"
/// ```
///
/// ```python
/// import math
///
/// def simulate(frequency, damping, layout):
///     times = layout["axes"][0]["values"]
///     return [math.exp(-damping * t) * math.cos(2 * math.pi * frequency * t) for t in times]
/// ```
///
/// The function receives each input of the study (parameters, fixed values, values of a scenario) as an argument of
/// that name, in the study's unit or in that of `units`; a random field (`[[field]]`) is one argument, the list of its
/// values at its places (a `numpy` array if the file imports `numpy`). An argument `layout` receives the response's `name`, `unit`
/// and `axes` (each with `name`, and `labels` or `values` and `unit`); an argument `scenario` receives the scenario's
/// `name`, `values` and `functions`. The function returns the response: an array or nested lists of the layout's
/// shape, one flat list in row-major order, or dicts by label. Numbers are passed without rounding.
///
/// With `vectorised` every input is a sequence with one value per run (a `numpy` array if the file imports `numpy`;
/// that of a field has the runs along its first axis), and the function returns one response per run; its result for one run must not depend on the other runs.
///
/// Worker processes load the file once each; there are as many workers as concurrent runs. Output that the function
/// prints does not affect the results. If the function raises an exception, exceeds the time limit or ends its
/// worker, the run has failed with that reason, and the next run uses a new worker. The interpreter must be Python
/// 3.8 or later; no package is required.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Python {
    /// Path of the Python file, relative to the study file. Existing runs are made again if this file changes, but
    /// not if a module that it imports changes.
    pub file: PathBuf,
    /// Name of the function.
    #[serde(default = "simulate")]
    pub function: String,
    /// Python interpreter, or the directory of a virtual environment. A value with a `/` is a path relative to the
    /// study file; a name is searched for in `PATH`.
    #[serde(default = "python3")]
    pub interpreter: PathBuf,
    /// If `true`, the function receives several runs in one call.
    #[serde(default)]
    pub vectorised: bool,
    /// Maximum number of runs per call of a vectorised function.
    #[serde(default = "hundred")]
    pub batch: Count,
    /// Name of a function in the same file that returns the derivatives of the response with respect to the inputs: a
    /// dict with an array of the response's shape for each input (with the places of a field as an additional last axis),
    /// or one array with the inputs as an additional last
    /// axis. Without it, methods that use derivatives are not available for this model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gradient: Option<String>,
    /// Units in which the function receives inputs; inputs that are not listed use the study's units.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, Unit>,
    /// Time limit for one call (of all its runs, if vectorised), in seconds; when it passes, the call is stopped and
    /// its runs have failed. Default: no limit. Loading the file may take 60 seconds, or `timeout` if that is longer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeout: Option<Positive>,
    #[serde(skip)]
    pool: Pool,
}

fn simulate() -> String {
    "simulate".to_owned()
}

fn python3() -> PathBuf {
    PathBuf::from("python3")
}

fn hundred() -> Count {
    Count::new(100).unwrap_or_else(|_| unreachable!("100 is 1 or more"))
}

impl Component for Python {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        given::check_units(&self.units, context, complaints);
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        check::files(self, context, complaints);
    }
}

impl Model for Python {
    fn signature(&self, context: &Context<'_>) -> Signature {
        given::signature(context, &self.units)
    }

    fn files(&self, directory: &Path) -> Vec<PathBuf> {
        vec![directory.join(&self.file)]
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        given::sound(call)?;
        let values = self.pool.ask(self, "simulate", &[*call])?;
        given::response(values, call.layout, Vec::new())
    }

    fn batch(&self) -> usize {
        if self.vectorised { self.batch.get() } else { 1 }
    }

    fn predict_batch(&self, calls: &[Call<'_>]) -> Vec<Result<Response, EvalError>> {
        let alone = || calls.iter().map(|call| self.predict(call)).collect();
        let [first, _, ..] = calls else { return alone() };
        let all_sound = calls.iter().all(|call| given::sound(call).is_ok());
        if !self.vectorised || !all_sound {
            return alone();
        }
        // If one run of a call fails there is no result for any of them; each run is then made by itself.
        match self.pool.ask(self, "simulate", calls) {
            Ok(values) if values.len() == calls.len() * first.layout.len() => values
                .chunks(first.layout.len())
                .map(|values| given::response(values.to_vec(), first.layout, Vec::new()))
                .collect(),
            _ => alone(),
        }
    }

    fn gradient(&self) -> Option<&dyn Gradient> {
        self.gradient.as_ref().map(|_| self as &dyn Gradient)
    }
}

impl Gradient for Python {
    fn jacobian(&self, call: &Call<'_>) -> Result<Matrix, EvalError> {
        given::sound(call)?;
        let values = self.pool.ask(self, "gradient", &[*call])?;
        let (rows, inputs) = (call.layout.len(), call.inputs.len());
        let name = self.gradient.as_deref().unwrap_or_default();
        if values.len() != rows * inputs {
            let (found, expected) = (values.len(), rows * inputs);
            let text = format!("`{name}` gave {found} derivatives, expected {expected}");
            return Err(EvalError::Rejected(text));
        }
        if let Some(i) = values.iter().position(|x| !x.is_finite()) {
            let (input, place) = (&call.names[i % inputs], call.layout.describe(i / inputs));
            let text = format!("the derivative by `{input}` is {} at {place}", values[i]);
            return Err(EvalError::Rejected(text));
        }
        Ok(Matrix::from_fn(rows, inputs, |i, j| values[i * inputs + j]))
    }
}

lacuna::register!(Model, "python", Python, aliases: ["py"]);

#[cfg(all(test, unix))]
mod tests;
