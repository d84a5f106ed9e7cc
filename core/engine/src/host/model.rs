//! Models of libraries.

use std::path::{Path, PathBuf};

use lacuna::plugin::Context;
use lacuna::plugin::model::{Call, EvalError, Gradient, Model, Response, Signature};
use lacuna_abi::check::{UNMARKED, marks, numbers_only};
use lacuna_abi::object::numbers_if_any;
use lacuna_abi::table::{Calls, ModelFunctions, Numbers, Text};
use lacuna_abi::wire::{CallSaid, CallsAbout, OwnedContext, ResponseAbout, SignatureAbout};
use lacuna_abi::{Refusal, Reply, status};
use lacuna_linalg::Matrix;

use super::Plugin;

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

    /// The struct that is handed to the other side: valid for as long as this value stays where it is.
    fn table(&self) -> Calls {
        Calls {
            size: size_of::<Calls>(),
            inputs: Numbers::of(&self.inputs),
            about: Text::of(&self.about),
            folders: Text::of(&self.folders),
        }
    }
}

impl Plugin<ModelFunctions> {
    fn answers(&self, calls: &[Call<'_>]) -> Result<Vec<Result<Response, EvalError>>, Refusal> {
        let Some(handed) = HandedCalls::of(calls)? else { return Ok(Vec::new()) };
        let (table, outputs) = (handed.table(), handed.outputs);
        let mut values = Matrix::from_fn(calls.len(), outputs, |_, _| f64::NAN);
        let mut statuses = vec![status::FATAL; calls.len()];
        let mut valid = vec![UNMARKED; calls.len()];
        let (to, codes, valid_to) =
            (values.as_mut_slice().as_mut_ptr(), statuses.as_mut_ptr(), valid.as_mut_ptr());
        // SAFETY: the buffers have a place for each call.
        let asked = unsafe { self.object.predict(&raw const table, to, codes, valid_to) };
        let said = said(&asked.demand()?, calls.len())?;
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
        // SAFETY: the buffer holds `outputs x inputs` numbers.
        let call = |to| unsafe { self.object.jacobian(&raw const table, to) };
        let slopes = numbers_if_any(rows * columns, call)?;
        Ok(slopes.map(|slopes| Matrix::from_vec(rows, columns, slopes)))
    }

    /// The response with its derivatives from one run; `None` where the model gives them one by one only.
    fn both(&self, call: &Call<'_>) -> Result<Option<(Response, Matrix)>, Refusal> {
        let Some(handed) = HandedCalls::of(&[*call])? else { return Ok(None) };
        let (table, rows, columns) = (handed.table(), handed.outputs, call.inputs.len());
        let (mut values, mut valid) = (vec![f64::NAN; rows], UNMARKED);
        let (response, mark) = (values.as_mut_ptr(), &raw mut valid);
        let mut slopes = vec![f64::NAN; rows * columns];
        let to = slopes.as_mut_ptr();
        // SAFETY: the buffers hold `outputs` and `outputs x inputs` numbers and one mark.
        let asked = unsafe { self.object.with_response(&raw const table, response, to, mark) };
        let Some(reply) = asked.if_any()? else { return Ok(None) };
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
        let Some(handed) = HandedCalls::of(&[*call])? else { return Ok(None) };
        let about = ResponseAbout { valid: response.valid, facts: response.facts.clone() };
        let (about, folder) = (serde_json::to_string(&about)?, directory.to_string_lossy());
        let (table, values) = (handed.table(), &response.values[..]);
        // SAFETY: the calls are there until the call returns.
        let asked = unsafe { self.object.write(run, &raw const table, values, &about, &*folder) };
        Ok(asked.if_any()?.map(|reply| reply.string()))
    }

    /// True for a model that knows derivatives at all: it is asked with no call.
    fn has_slopes(&self) -> bool {
        let about = CallsAbout {
            names: Vec::new(),
            units: Vec::new(),
            layout: lacuna::data::Layout::number("y"),
            scenario: lacuna::data::Scenario::default(),
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
        // SAFETY: with no call nothing is written.
        let asked = unsafe { self.object.jacobian(&raw const table, std::ptr::null_mut()) };
        asked.demand().is_ok()
    }
}

/// The message and the facts of each call.
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
    /// The mark: 1 where the run stayed inside the model's range of validity.
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
            // SAFETY: nothing is written.
            unsafe { self.object.signature(&text) }.json_if_any()
        };
        self.object.or_fault(said(), SignatureAbout::default).in_study(context)
    }

    fn unused(&self, context: &Context<'_>) -> Vec<String> {
        let said = || {
            let text = serde_json::to_string(&OwnedContext::from(context))?;
            // SAFETY: nothing is written.
            unsafe { self.object.unused(&text) }.json_if_any()
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
        // SAFETY: nothing is written.
        let asked = unsafe { self.object.files(&*directory.to_string_lossy()) };
        self.object.or_fault(asked.json_if_any(), Vec::new)
    }

    fn batch(&self) -> usize {
        // SAFETY: nothing is written.
        unsafe { self.object.batch() }.unwrap_or(1).max(1)
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
