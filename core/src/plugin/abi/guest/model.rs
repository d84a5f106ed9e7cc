//! Models of a library.

use std::ffi::c_void;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::component::{Authored, Components, Export};
use crate::linalg::Matrix;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{fill, guard, guard_number, object};
use crate::plugin::abi::table::{
    Answer, Calls, ComponentFunctions, ModelFunctions, Numbers, Text, status,
};
use crate::plugin::abi::wire::{CallSaid, CallsAbout, OwnedContext, ResponseAbout, SignatureAbout};
use crate::plugin::model::{Call, EvalError, Response};
use crate::plugin::{Context, Model};

impl<T: Model + Authored, const REVISION: u32> Export<T, REVISION> for dyn Model {
    const FUNCTIONS: *const c_void = std::ptr::from_ref(Functions::<T>::TABLE).cast();
    const COMPONENT: *const ComponentFunctions = Components::<T, REVISION>::FUNCTIONS;
}

struct Functions<T>(std::marker::PhantomData<T>);

impl<T: Model + Authored> Functions<T> {
    const TABLE: &'static ModelFunctions = &ModelFunctions {
        size: size_of::<ModelFunctions>(),
        signature: Some(signature::<T>),
        predict: Some(predict::<T>),
        batch: Some(batch::<T>),
        unused: Some(unused::<T>),
        files: Some(files::<T>),
        write: Some(write::<T>),
        jacobian: Some(jacobian::<T>),
        with_response: Some(with_response::<T>),
    };
}

/// Evaluations that were copied.
struct OwnedCalls {
    inputs: Matrix,
    about: CallsAbout,
    folders: Vec<Option<PathBuf>>,
}

impl OwnedCalls {
    /// Copies calls.
    ///
    /// # Safety
    /// All that the struct points to is there.
    unsafe fn read(calls: &Calls) -> Result<Self, Refusal> {
        // SAFETY: as the caller promises.
        let (inputs, about, folders) =
            unsafe { (calls.inputs.matrix()?, calls.about.bytes(), calls.folders.bytes()) };
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

/// Answers what a model says of a study.
///
/// # Safety
/// The plugin is one that `create` made, and the text is there.
unsafe fn of_context<T: Model + Authored, S: Serialize>(
    plugin: *mut c_void,
    context: Text,
    answer: *const Answer,
    tell: fn(&T, &Context<'_>) -> S,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as the caller promises.
        let (plugin, context) = unsafe { (object::<T>(plugin), context.bytes()) };
        let context: OwnedContext = serde_json::from_slice(context)?;
        out.json(&context.with(|context| tell(plugin, context)))
    })
}

unsafe extern "C" fn signature<T: Model + Authored>(
    plugin: *mut c_void,
    context: Text,
    answer: *const Answer,
) -> i32 {
    let tell = |plugin: &T, context: &Context<'_>| SignatureAbout::from(plugin.signature(context));
    // SAFETY: as this function's caller promises.
    unsafe { of_context::<T, _>(plugin, context, answer, tell) }
}

unsafe extern "C" fn unused<T: Model + Authored>(
    plugin: *mut c_void,
    context: Text,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe { of_context::<T, _>(plugin, context, answer, Model::unused) }
}

unsafe extern "C" fn files<T: Model + Authored>(
    plugin: *mut c_void,
    directory: Text,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: the plugin that `create` made, and a text that is there for the time of the call.
        let (plugin, directory) = unsafe { (object::<T>(plugin), directory.string()) };
        out.json(&plugin.files(Path::new(&directory)))
    })
}

unsafe extern "C" fn batch<T: Model + Authored>(plugin: *mut c_void) -> usize {
    // SAFETY: the plugin that `create` made.
    guard_number(1, || unsafe { object::<T>(plugin) }.batch())
}

unsafe extern "C" fn predict<T: Model + Authored>(
    plugin: *mut c_void,
    calls: *const Calls,
    responses: *mut f64,
    statuses: *mut i32,
    valid: *mut u8,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: the plugin that `create` made; the calls are there for the time of the call.
        let (plugin, calls) = unsafe { (object::<T>(plugin), OwnedCalls::read(&*calls)?) };
        let outputs = calls.about.layout.len();
        let mut said = Vec::new();
        for (i, made) in plugin.predict_batch(&calls.calls()).into_iter().enumerate() {
            let (code, response, message) = match made {
                Ok(response) => (status::OK, Some(response), String::new()),
                Err(EvalError::Rejected(message)) => (status::REJECTED, None, message),
                Err(EvalError::Fatal(message)) => (status::FATAL, None, message),
            };
            // SAFETY: the buffers have a place for each call.
            unsafe {
                *statuses.add(i) = code;
                *valid.add(i) = u8::from(response.as_ref().is_some_and(|r| r.valid));
                if let Some(Response { values, .. }) = &response {
                    fill(responses.add(i * outputs), outputs, values)?;
                }
            }
            said.push(CallSaid { message, facts: response.map(|r| r.facts).unwrap_or_default() });
        }
        if said.iter().all(|said| *said == CallSaid::default()) { Ok(()) } else { out.json(&said) }
    })
}

unsafe extern "C" fn jacobian<T: Model + Authored>(
    plugin: *mut c_void,
    calls: *const Calls,
    to: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `predict`.
        let (plugin, calls) = unsafe { (object::<T>(plugin), OwnedCalls::read(&*calls)?) };
        let gradient = plugin.gradient().ok_or_else(Refusal::absent)?;
        let count = calls.about.layout.len() * calls.inputs.columns();
        // A call without inputs asks whether there are derivatives at all.
        let Some(call) = calls.calls().into_iter().next() else { return Ok(()) };
        let slopes = gradient.jacobian(&call)?;
        // SAFETY: the buffer holds `outputs x inputs` numbers.
        unsafe { fill(to, count, slopes.as_slice()) }
    })
}

unsafe extern "C" fn with_response<T: Model + Authored>(
    plugin: *mut c_void,
    calls: *const Calls,
    response: *mut f64,
    to: *mut f64,
    valid: *mut u8,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `predict`.
        let (plugin, calls) = unsafe { (object::<T>(plugin), OwnedCalls::read(&*calls)?) };
        let outputs = calls.about.layout.len();
        let gradient = plugin.gradient().ok_or_else(Refusal::absent)?;
        let call = calls.calls().into_iter().next().ok_or_else(Refusal::absent)?;
        let (made, slopes) = gradient.with_response(&call).ok_or_else(Refusal::absent)??;
        // SAFETY: the buffers hold `outputs` and `outputs x inputs` numbers and one mark.
        unsafe {
            fill(response, outputs, &made.values)?;
            fill(to, outputs * calls.inputs.columns(), slopes.as_slice())?;
            *valid = u8::from(made.valid);
        }
        if made.facts.is_empty() {
            return Ok(());
        }
        out.json(&[CallSaid { message: String::new(), facts: made.facts }])
    })
}

unsafe extern "C" fn write<T: Model + Authored>(
    plugin: *mut c_void,
    run: Text,
    calls: *const Calls,
    response: Numbers,
    about: Text,
    directory: Text,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `predict`.
        let (plugin, calls) = unsafe { (object::<T>(plugin), OwnedCalls::read(&*calls)?) };
        // SAFETY: as above.
        let (run, values, about, directory) = unsafe {
            (run.string(), response.slice()?.to_vec(), about.bytes(), directory.string())
        };
        let ResponseAbout { valid, facts } = serde_json::from_slice(about)?;
        let response = Response { values, valid, facts };
        let Some(call) = calls.calls().into_iter().next() else { return Err(Refusal::absent()) };
        let file = plugin.write(&run, &call, &response, Path::new(&directory))?;
        out.text(&file.ok_or_else(Refusal::absent)?);
        Ok(())
    })
}
