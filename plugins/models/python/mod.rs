//! `python`: a function in a Python file as a simulator.

mod check;
mod frame;
mod pool;
mod worker;
mod written;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lacuna::data::Unit;
use lacuna::linalg::Matrix;
use lacuna::plugin::model::{Call, EvalError, Gradient, Response, Signature};
use lacuna::plugin::{Component, Context, Model};
use lacuna::study::problem::Complaints;
use lacuna::study::values::{Count, Positive};
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
/// The function gets each input that the study gives (parameters, fixed values, values of a scenario) under
/// its name, in the study's unit or in that of `units`. If it has an argument `layout` it gets the response's `name`,
/// `unit` and `axes` (each with `name`, and `labels` or `values` and `unit`); if it has an argument `scenario`,
/// that scenario's `name`, `values` and `functions`. It returns the response: an array or nested lists of the
/// layout's shape, one flat list in row-major order, or dicts by label. Numbers are passed exactly.
///
/// With `vectorised` every input is a sequence with one value a run (an array, if the file imports `numpy`), and the
/// function returns one response a run; what it does for one run must not depend on the others.
///
/// The file is loaded once by a worker process; as many workers run as runs are made at a time. What the
/// function prints goes nowhere near the results. A run whose function raises an exception, hangs, or takes its worker
/// down counts as failed with the reason; the next run gets a new worker. Only the Python interpreter is needed (3.8
/// or later), no package.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Python {
    /// The Python file, relative to the study file. Runs are made again when it changes, but not when a module changes
    /// that it imports.
    pub file: PathBuf,
    /// The function.
    #[serde(default = "simulate")]
    pub function: String,
    /// The interpreter, or the folder of a virtual environment: with a `/` relative to the study file, else looked up
    /// in `PATH`.
    #[serde(default = "python3")]
    pub interpreter: PathBuf,
    /// Whether the function takes several runs in one call.
    #[serde(default)]
    pub vectorised: bool,
    /// How many runs a vectorised function gets at most.
    #[serde(default = "hundred")]
    pub batch: Count,
    /// A function in the same file that returns the derivatives of the response by the inputs: a dict with an
    /// array like the response for each input, or one array with the inputs on an additional last axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gradient: Option<String>,
    /// Units in which the function takes inputs, where they are not the study's.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, Unit>,
    /// Seconds after which a call (of all runs in it, if vectorised) is stopped; no limit when left out.
    /// Loading the file may take a minute, or as long if that is longer.
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
        // One run that goes wrong spoils all of the call: then each is asked for by itself.
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
