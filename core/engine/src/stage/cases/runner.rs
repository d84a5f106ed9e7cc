//! Cases as the runs of a model.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use lacuna::data::Layout;
use lacuna::plugin::model::{Call, EvalError, Model, Response, Signature};
use lacuna::plugin::{Component, Context};
use lacuna::run::files;

use super::{Make, Outcome};

/// The cases of a stage as a model: its input is the number of a case, and it answers in a file.
pub struct Runner<'a, T> {
    /// Folder of the stage.
    pub folder: &'a Path,
    /// Computes a case.
    pub make: &'a Make<'a, T>,
}

/// File of the outcome of the case with this number, inside the folder of the stage.
pub fn file_of(number: usize) -> String {
    file(&super::job(number).name)
}

fn file(case: &str) -> String {
    format!("campaign/outcomes/{case}.json")
}

impl<T> Component for Runner<'_, T> {}

impl<T: Outcome> Model for Runner<'_, T> {
    fn signature(&self, _: &Context<'_>) -> Signature {
        Signature { inputs: Vec::new(), layout: Layout::number("case"), resamples: false }
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        let number = call.inputs[0] as usize;
        let made = catch_unwind(AssertUnwindSafe(|| (self.make)(number)));
        let made = made.map_err(|panic| EvalError::Rejected(words(&*panic)))?;
        let outcome = made.map_err(|stop| EvalError::Fatal(stop.to_string()))?;
        let path = self.folder.join(file_of(number));
        files::write_json(&path, &outcome).map_err(|stop| EvalError::Fatal(stop.to_string()))?;
        let values = vec![0.0; call.layout.len()];
        Ok(Response { values, valid: outcome.is_settled(), facts: Vec::new() })
    }

    /// The file exists: the response has no room for an outcome.
    fn write(
        &self,
        run: &str,
        _: &Call<'_>,
        _: &Response,
        _: &Path,
    ) -> Result<Option<String>, EvalError> {
        Ok(Some(file(run)))
    }
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    format!("it panicked: {}", text.unwrap_or("without a message"))
}
