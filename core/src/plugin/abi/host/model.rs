//! Models of libraries.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::Plugin;
use super::object::{UNMARKED, marks, numbers_only};
use super::plugin::optional;
use crate::linalg::Matrix;
use crate::plugin::Context;
use crate::plugin::abi::table::{Answer, Calls, ModelFunctions, Numbers, Text, status};
use crate::plugin::abi::wire::{CallSaid, CallsAbout, OwnedContext, ResponseAbout, SignatureAbout};
use crate::plugin::abi::{Refusal, Reply};
use crate::plugin::model::{Call, EvalError, Gradient, Model, Response, Signature};

/// Calls as they are handed over.
struct HandedCalls {
    inputs: Matrix,
    about: String,
    folders: String,
    outputs: usize,
}

impl HandedCalls {
    /// Calls that have all but inputs and folders in common.
    fn of(calls: &[Call<'_>]) -> Result<Option<Self>, Refusal> {
        let Some(first) = calls.first() else { return Ok(None) };
        let about = CallsAbout {
            names: first.names.to_vec(),
            units: first.units.to_vec(),
            layout: first.layout.clone(),
            scenario: first.scenario.clone(),
            study: first.study.to_owned(),
        };
        let folders: Vec<Option<&Path>> = calls.iter().map(|call| call.directory).collect();
        Ok(Some(Self {
            inputs: Matrix::from_rows(first.inputs.len(), calls.iter().map(|call| call.inputs)),
            about: serde_json::to_string(&about)?,
            folders: serde_json::to_string(&folders)?,
            outputs: first.layout.len(),
        }))
    }

    /// What the other side is given: good for as long as this value stays where it is.
    fn table(&self) -> Calls {
        Calls {
            size: size_of::<Calls>(),
            inputs: Numbers::of(&self.inputs),
            about: Text::of(&self.about),
            folders: Text::of(&self.folders),
        }
    }
}

/// A function that answers something about a text.
type Told = Option<unsafe extern "C" fn(*mut std::ffi::c_void, Text, *const Answer) -> i32>;

impl Plugin<ModelFunctions> {
    fn told<T: DeserializeOwned + Default>(
        &self,
        what: &'static str,
        ask: Told,
        text: &str,
    ) -> Result<T, Refusal> {
        let this = self.object.this;
        // SAFETY: the function belongs to the plugin, and the text is there until it returns.
        let call = |a| optional(ask, |f| unsafe { f(this, Text::of(text), a) });
        Ok(self.object.ask(what, call)?.unwrap_or_default().json_if_any()?.unwrap_or_default())
    }

    fn answers(&self, calls: &[Call<'_>]) -> Result<Vec<Result<Response, EvalError>>, Refusal> {
        let Some(handed) = HandedCalls::of(calls)? else { return Ok(Vec::new()) };
        let (table, outputs) = (handed.table(), handed.outputs);
        let mut values = Matrix::from_fn(calls.len(), outputs, |_, _| f64::NAN);
        let mut statuses = vec![status::FATAL; calls.len()];
        let mut valid = vec![UNMARKED; calls.len()];
        let (ask, this) = (self.object.functions.predict, self.object.this);
        let (to, codes, valid_to) =
            (values.as_mut_slice().as_mut_ptr(), statuses.as_mut_ptr(), valid.as_mut_ptr());
        // SAFETY: the function belongs to the plugin; the buffers have a place for each call.
        let call =
            |a| optional(ask, |f| unsafe { f(this, &raw const table, to, codes, valid_to, a) });
        let said = said(&self.object.demand("predict", call)?, calls.len())?;
        let each = said.into_iter().enumerate().map(|(i, said)| {
            let answer = Answered {
                what: "predict",
                code: statuses[i],
                valid: valid[i],
                values: values.row(i),
                said,
            };
            self.object.or_error(answer.response())
        });
        Ok(each.collect())
    }

    fn slopes(&self, call: &Call<'_>) -> Result<Option<Matrix>, Refusal> {
        let Some(handed) = HandedCalls::of(&[*call])? else { return Ok(None) };
        let (table, rows, columns) = (handed.table(), handed.outputs, call.inputs.len());
        let (ask, this) = (self.object.functions.jacobian, self.object.this);
        let slopes = self.object.ask_numbers("jacobian", rows * columns, |to, a| {
            // SAFETY: the function belongs to the plugin; the buffer holds `outputs x inputs` numbers.
            optional(ask, |f| unsafe { f(this, &raw const table, to, a) })
        })?;
        Ok(slopes.map(|slopes| Matrix::from_vec(rows, columns, slopes)))
    }

    /// The response with its derivatives from one run; `None` where the model gives them one by one only.
    fn both(&self, call: &Call<'_>) -> Result<Option<(Response, Matrix)>, Refusal> {
        let Some(ask) = self.object.functions.with_response else { return Ok(None) };
        let Some(handed) = HandedCalls::of(&[*call])? else { return Ok(None) };
        let (table, rows, columns) = (handed.table(), handed.outputs, call.inputs.len());
        let (mut values, mut valid) = (vec![f64::NAN; rows], UNMARKED);
        let (this, response, mark) = (self.object.this, values.as_mut_ptr(), &raw mut valid);
        let mut slopes = vec![f64::NAN; rows * columns];
        let to = slopes.as_mut_ptr();
        // SAFETY: the function belongs to the plugin; the buffers hold `outputs` and `outputs x inputs` numbers and one
        // mark, and are there until it returns.
        let ask = |a| unsafe { ask(this, &raw const table, response, to, mark, a) };
        let Some(reply) = self.object.ask("with_response", ask)? else { return Ok(None) };
        let said = said(&reply, 1)?.pop().unwrap_or_default();
        let answered =
            Answered { what: "with_response", code: status::OK, valid, values: &values, said };
        let response = answered.response()?;
        numbers_only("with_response", &slopes)?;
        Ok(Some((response, Matrix::from_vec(rows, columns, slopes))))
    }

    fn written(
        &self,
        run: &str,
        call: &Call<'_>,
        response: &Response,
        directory: &Path,
    ) -> Result<Option<String>, Refusal> {
        let Some(ask) = self.object.functions.write else { return Ok(None) };
        let Some(handed) = HandedCalls::of(&[*call])? else { return Ok(None) };
        let about = ResponseAbout { valid: response.valid, facts: response.facts.clone() };
        let (about, folder) = (serde_json::to_string(&about)?, directory.to_string_lossy());
        let (table, values, this) =
            (handed.table(), Numbers::row(&response.values), self.object.this);
        let (run, about, folder) = (Text::of(run), Text::of(&about), Text::of(&folder));
        // SAFETY: the function belongs to the plugin; all that it is given is there until it returns.
        let call = |a| unsafe { ask(this, run, &raw const table, values, about, folder, a) };
        Ok(self.object.ask("write", call)?.map(|reply| reply.string()))
    }

    /// Whether the model knows derivatives at all: it is asked with no call.
    fn has_slopes(&self) -> bool {
        let Some(ask) = self.object.functions.jacobian else { return false };
        let about = CallsAbout {
            names: Vec::new(),
            units: Vec::new(),
            layout: crate::data::Layout::number("y"),
            scenario: crate::data::Scenario::default(),
            study: PathBuf::new(),
        };
        let Ok(about) = serde_json::to_string(&about) else { return false };
        let nothing = Matrix::zeros(0, 0);
        let table = Calls {
            size: size_of::<Calls>(),
            inputs: Numbers::of(&nothing),
            about: Text::of(&about),
            folders: Text::of(""),
        };
        // SAFETY: the function belongs to the plugin; with no call it writes nothing.
        let call = |a| unsafe { ask(self.object.this, &raw const table, std::ptr::null_mut(), a) };
        Reply::of("jacobian", call).is_ok()
    }
}

/// What is said of each call.
fn said(reply: &Reply, count: usize) -> Result<Vec<CallSaid>, Refusal> {
    let said: Option<Vec<Option<CallSaid>>> = reply.json_if_any()?;
    let Some(said) = said else { return Ok(vec![CallSaid::default(); count]) };
    if said.len() != count {
        let found = said.len();
        let what = reply.what;
        return Err(Refusal::stop(format!(
            "`{what}` says something of {found} calls where there are {count}"
        )));
    }
    Ok(said.into_iter().map(Option::unwrap_or_default).collect())
}

/// The answer to one call.
struct Answered<'a> {
    /// The function that was called.
    what: &'static str,
    code: i32,
    /// Its mark: 1 where the run stayed inside the model's range of validity.
    valid: u8,
    values: &'a [f64],
    said: CallSaid,
}

impl Answered<'_> {
    fn response(self) -> Result<Response, Refusal> {
        let Self { what, code, valid, values, said: CallSaid { message, facts } } = self;
        match code {
            status::OK => {}
            status::REJECTED..=status::ABSENT if message.is_empty() => {
                let message = format!("`{what}` has no answer and gives no reason");
                return Err(Refusal::new(code, message));
            }
            status::REJECTED..=status::ABSENT => return Err(Refusal::new(code, message)),
            other => {
                let message =
                    format!("`{what}` gives a run the status {other}, which has no meaning");
                return Err(Refusal::stop(message));
            }
        }
        let valid = marks(what, &[valid])?[0];
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(Response { values: values.to_vec(), valid, facts }),
            Some(i) => {
                let (count, found) = (values.len(), values[i]);
                let message = format!("`{what}` gives {found} as value {} of {count}", i + 1);
                Err(Refusal::new(status::REJECTED, message))
            }
        }
    }
}

impl Model for Plugin<ModelFunctions> {
    fn signature(&self, context: &Context<'_>) -> Signature {
        let said = || {
            let text = serde_json::to_string(&OwnedContext::from(context))?;
            self.told::<SignatureAbout>("signature", self.object.functions.signature, &text)
        };
        self.object.or_fault(said(), SignatureAbout::default).in_study(context)
    }

    fn unused(&self, context: &Context<'_>) -> Vec<String> {
        let said = || {
            let text = serde_json::to_string(&OwnedContext::from(context))?;
            self.told("unused", self.object.functions.unused, &text)
        };
        self.object.or_fault(said(), Vec::new)
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        let silent = || {
            EvalError::Fatal(format!("{}: `predict` answers nothing", self.object.fault().who()))
        };
        self.predict_batch(&[*call]).pop().unwrap_or_else(|| Err(silent()))
    }

    fn files(&self, directory: &Path) -> Vec<PathBuf> {
        let said = self.told("files", self.object.functions.files, &directory.to_string_lossy());
        self.object.or_fault(said, Vec::new)
    }

    fn batch(&self) -> usize {
        // SAFETY: the function belongs to the plugin.
        self.object.functions.batch.map_or(1, |f| unsafe { f(self.object.this) }).max(1)
    }

    fn predict_batch(&self, calls: &[Call<'_>]) -> Vec<Result<Response, EvalError>> {
        let answers = self.object.or_error(self.answers(calls));
        answers.unwrap_or_else(|error| calls.iter().map(|_| Err(error.clone())).collect())
    }

    fn write(
        &self,
        run: &str,
        call: &Call<'_>,
        response: &Response,
        directory: &Path,
    ) -> Result<Option<String>, EvalError> {
        self.object.or_error(self.written(run, call, response, directory))
    }

    fn gradient(&self) -> Option<&dyn Gradient> {
        self.has_slopes().then_some(self)
    }
}

impl Gradient for Plugin<ModelFunctions> {
    fn jacobian(&self, call: &Call<'_>) -> Result<Matrix, EvalError> {
        let slopes = self.object.or_error(self.slopes(call))?;
        let none =
            || EvalError::Fatal(format!("{}: `jacobian` is not there", self.object.fault().who()));
        slopes.ok_or_else(none)
    }

    fn with_response(&self, call: &Call<'_>) -> Option<Result<(Response, Matrix), EvalError>> {
        self.object.or_error(self.both(call)).transpose()
    }
}
