//! Workers of a model: each handles one call at a time and is kept for the next.

use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use lacuna::plugin::model::{Call, EvalError};
use lacuna::text::values::Positive;
use serde_json::json;

use super::Python;
use super::frame::Answer;
use super::worker::{Silent, Worker};
use lacuna_run::process::interpreter;

/// Minimum time limit for loading a file, however short the limit of a call: loading includes the packages that it
/// imports.
const LOADING: Duration = Duration::from_secs(60);

/// Workers that are ready for a call.
#[derive(Debug, Default)]
pub struct Pool(Mutex<Vec<Worker>>);

impl Pool {
    /// Answer of a function of the model's file to several calls in one request.
    pub fn ask(
        &self,
        model: &Python,
        what: &str,
        calls: &[Call<'_>],
    ) -> Result<Vec<f64>, EvalError> {
        let Some(call) = calls.first() else { return Ok(Vec::new()) };
        let limit = model.timeout.map(Positive::seconds);
        let mut worker = match self.waiting() {
            Some(worker) => worker,
            None => start(model, call.study, limit.map(|limit| limit.max(LOADING)))?,
        };
        worker.prepare(call, limit).map_err(|why| match why {
            Silent::Failed(text) => EvalError::Fatal(format!("{}: {text}", shown(&model.file))),
            other => EvalError::Fatal(told(model, &model.function, other)),
        })?;
        let rows: Vec<&[f64]> = calls.iter().map(|call| call.inputs).collect();
        let function = match (what, &model.gradient) {
            ("gradient", Some(gradient)) => gradient,
            _ => &model.function,
        };
        match worker.ask(&json!({ "call": what, "rows": rows }), limit) {
            Ok(Answer::Values(values)) => {
                self.keep(worker);
                Ok(values)
            }
            Ok(Answer::Failed(text)) => {
                self.keep(worker);
                let text = told(model, function, Silent::Failed(text));
                Err(EvalError::Rejected(text))
            }
            // The rest of the worker is ended when it is dropped.
            Err(silent) => Err(EvalError::Rejected(told(model, function, silent))),
        }
    }

    /// A worker that is ready and still running.
    fn waiting(&self) -> Option<Worker> {
        loop {
            let mut worker = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop()?;
            if worker.is_running() {
                return Some(worker);
            }
        }
    }

    fn keep(&self, worker: Worker) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(worker);
    }
}

fn start(model: &Python, study: &Path, limit: Option<Duration>) -> Result<Worker, EvalError> {
    let study = std::path::absolute(study).unwrap_or_else(|_| study.to_owned());
    let interpreter = interpreter(&model.interpreter, &study).ok_or_else(|| {
        let name = model.interpreter.display();
        EvalError::Fatal(format!("there is no Python interpreter `{name}`"))
    })?;
    let arguments = [
        study.join(&model.file).display().to_string(),
        model.function.clone(),
        model.gradient.clone().unwrap_or_default(),
        if model.vectorised { "vectorised".to_owned() } else { String::new() },
    ];
    let started = Worker::start(&interpreter, &arguments, &study, limit);
    started.map_err(|why| {
        EvalError::Fatal(match why {
            Silent::Failed(text) => format!("{} cannot be loaded: {text}", shown(&model.file)),
            Silent::Late => format!("{} was not loaded in time", shown(&model.file)),
            Silent::Ended(text) => {
                format!("the Python interpreter `{}` {text}", model.interpreter.display())
            }
        })
    })
}

fn shown(file: &Path) -> String {
    format!("`{}`", file.display())
}

/// Message for a function that gave no answer.
fn told(model: &Python, function: &str, why: Silent) -> String {
    match why {
        Silent::Failed(text) => format!("`{function}` in {}: {text}", shown(&model.file)),
        Silent::Late => {
            let limit = model.timeout.map_or(0.0, Positive::get);
            format!("`{function}` in {} was stopped after {limit} s", shown(&model.file))
        }
        Silent::Ended(text) => {
            format!("`{function}` in {}: the worker {text}", shown(&model.file))
        }
    }
}
