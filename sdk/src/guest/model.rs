//! Models of a library.

use std::path::{Path, PathBuf};

use lacuna::matrix::Matrix;
use lacuna::plugin::Model;
use lacuna::plugin::model::{Call, EvalError, Response};
use lacuna_abi::argument::{Buffer, Lent, Rows, Space};
use lacuna_abi::guard::{Done, Out, fill};
use lacuna_abi::table::{Calls, ServeModel};
use lacuna_abi::wire::{CallSaid, CallsAbout, OwnedContext, ResponseAbout, SignatureAbout};
use lacuna_abi::{Refusal, status};

use super::{Authored, Plugin, text};

/// Evaluations that were copied.
struct OwnedCalls {
    inputs: Matrix,
    about: CallsAbout,
    folders: Vec<Option<PathBuf>>,
}

impl OwnedCalls {
    /// Copies calls.
    fn read(calls: Lent<'_, Calls>) -> Result<Self, Refusal> {
        // SAFETY: the table gives calls, and all that they point to is there for the time of the call.
        let (inputs, about, folders) = unsafe {
            let calls = calls.one();
            (calls.inputs.matrix()?, calls.about.bytes(), calls.folders.bytes())
        };
        let folders = match folders {
            [] => vec![None; inputs.rows()],
            folders => serde_json::from_slice(folders)?,
        };
        if folders.len() != inputs.rows() {
            return Err(Refusal::stop("the calls have not as many folders as inputs"));
        }
        Ok(Self { inputs, about: serde_json::from_slice(about)?, folders })
    }

    fn calls(&self) -> Vec<Call<'_>> {
        let about = &self.about;
        let call = |(inputs, folder)| Call {
            inputs,
            names: &about.names,
            units: &about.units,
            layout: &about.layout,
            scenario: &about.scenario,
            study: &about.study,
            directory: Option::<&PathBuf>::map(folder, AsRef::as_ref),
        };
        self.inputs.iter_rows().zip(self.folders.iter().map(Option::as_ref)).map(call).collect()
    }
}

impl<T: Model + Authored> ServeModel for Plugin<T> {
    fn signature(&self, context: &[u8], out: &Out) -> Done {
        let context: OwnedContext = serde_json::from_slice(context)?;
        out.json(&context.with(|context| SignatureAbout::from(self.0.signature(context))))
    }

    fn unused(&self, context: &[u8], out: &Out) -> Done {
        let context: OwnedContext = serde_json::from_slice(context)?;
        out.json(&context.with(|context| self.0.unused(context)))
    }

    fn files(&self, directory: &[u8], out: &Out) -> Done {
        out.json(&self.0.files(Path::new(&*text(directory))))
    }

    fn batch(&self) -> usize {
        self.0.batch()
    }

    fn predict(
        &self,
        calls: Lent<'_, Calls>,
        responses: Buffer<'_>,
        statuses: Space<'_, i32>,
        valid: Space<'_, u8>,
        out: &Out,
    ) -> Done {
        let calls = OwnedCalls::read(calls)?;
        let outputs = calls.about.layout.len();
        let mut said = Vec::new();
        for (i, made) in self.0.predict_batch(&calls.calls()).into_iter().enumerate() {
            let (code, response, message) = match made {
                Ok(response) => (status::OK, Some(response), String::new()),
                Err(EvalError::Rejected(message)) => (status::REJECTED, None, message),
                Err(EvalError::Fatal(message)) => (status::FATAL, None, message),
            };
            // SAFETY: the buffers have a place for each call.
            unsafe {
                *statuses.pointer().add(i) = code;
                *valid.pointer().add(i) = u8::from(response.as_ref().is_some_and(|r| r.valid));
                if let Some(Response { values, .. }) = &response {
                    fill(responses.pointer().add(i * outputs), outputs, values)?;
                }
            }
            said.push(CallSaid { message, facts: response.map(|r| r.facts).unwrap_or_default() });
        }
        if said.iter().all(|said| *said == CallSaid::default()) { Ok(()) } else { out.json(&said) }
    }

    fn jacobian(&self, calls: Lent<'_, Calls>, to: Buffer<'_>, _: &Out) -> Done {
        let calls = OwnedCalls::read(calls)?;
        let gradient = self.0.gradient().ok_or_else(Refusal::absent)?;
        let count = calls.about.layout.len() * calls.inputs.columns();
        // A call without inputs asks whether there are derivatives at all.
        let Some(call) = calls.calls().into_iter().next() else { return Ok(()) };
        let slopes = gradient.jacobian(&call)?;
        // SAFETY: the buffer holds `outputs x inputs` numbers.
        unsafe { to.fill(count, slopes.as_slice()) }
    }

    fn with_response(
        &self,
        calls: Lent<'_, Calls>,
        response: Buffer<'_>,
        to: Buffer<'_>,
        valid: Space<'_, u8>,
        out: &Out,
    ) -> Done {
        let calls = OwnedCalls::read(calls)?;
        let outputs = calls.about.layout.len();
        let gradient = self.0.gradient().ok_or_else(Refusal::absent)?;
        let call = calls.calls().into_iter().next().ok_or_else(Refusal::absent)?;
        let (made, slopes) = gradient.with_response(&call).ok_or_else(Refusal::absent)??;
        // SAFETY: the buffers hold `outputs` and `outputs x inputs` numbers and one mark.
        unsafe {
            response.fill(outputs, &made.values)?;
            to.fill(outputs * calls.inputs.columns(), slopes.as_slice())?;
            valid.put(u8::from(made.valid));
        }
        if made.facts.is_empty() {
            return Ok(());
        }
        out.json(&[CallSaid { message: String::new(), facts: made.facts }])
    }

    fn write(
        &self,
        run: &[u8],
        calls: Lent<'_, Calls>,
        response: Rows<'_>,
        about: &[u8],
        directory: &[u8],
        out: &Out,
    ) -> Done {
        let calls = OwnedCalls::read(calls)?;
        let ResponseAbout { valid, facts } = serde_json::from_slice(about)?;
        let response = Response { values: response.to_vec(), valid, facts };
        let Some(call) = calls.calls().into_iter().next() else { return Err(Refusal::absent()) };
        let file = self.0.write(&text(run), &call, &response, Path::new(&*text(directory)))?;
        out.text(&file.ok_or_else(Refusal::absent)?);
        Ok(())
    }
}
