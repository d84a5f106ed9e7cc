//! Discrepancies of a library.

mod compressed;
mod known;
mod likelihood;

use std::ffi::c_void;
use std::sync::Arc;

use super::component::{Authored, Components, Export};
use crate::linalg::Matrix;
use crate::plugin;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{begin, guard, mark, object};
use crate::plugin::abi::table::{
    Answer, ComponentFunctions, DiscrepancyFunctions, Known, Likelihood, Numbers, Text,
};
use crate::plugin::discrepancy::Discrepancy;
use crate::plugin::fault::Fault;
use known::OwnedKnown;

impl<T: Discrepancy + Authored, const REVISION: u32> Export<T, REVISION> for dyn Discrepancy {
    const FUNCTIONS: *const c_void = std::ptr::from_ref(Functions::<T>::TABLE).cast();
    const COMPONENT: *const ComponentFunctions = Components::<T, REVISION>::FUNCTIONS;
}

struct Functions<T>(std::marker::PhantomData<T>);

impl<T: Discrepancy + Authored> Functions<T> {
    const TABLE: &'static DiscrepancyFunctions = &DiscrepancyFunctions {
        size: size_of::<DiscrepancyFunctions>(),
        likelihood: Some(likelihood::<T>),
        stated_noise: Some(stated_noise::<T>),
        likelihood_of_part: Some(likelihood_of_part::<T>),
        takes_stated_noise: Some(takes_stated_noise::<T>),
    };
}

/// An object of the library with what may go wrong in what it asks of the program.
struct Guest<O: ?Sized> {
    own: Box<O>,
    fault: Arc<Fault>,
}

impl<O: ?Sized> Guest<O> {
    fn new(own: Box<O>, fault: Arc<Fault>) -> Self {
        Self { own, fault }
    }

    /// What went wrong in what was asked of the program.
    fn sound(&self) -> Result<(), Refusal> {
        sound(&self.fault)
    }
}

fn sound(fault: &Fault) -> Result<(), Refusal> {
    fault.said().map_or(Ok(()), |said| Err(Refusal::stop(said)))
}

/// Whose fault it is when the program does not answer.
fn fault() -> Arc<Fault> {
    Arc::new(Fault::new("the program"))
}

unsafe extern "C" fn likelihood<T: Discrepancy + Authored>(
    plugin: *mut c_void,
    known: *const Known,
    made: *mut Likelihood,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: the plugin that `create` made, and what is known is there for the time of the call.
        let (plugin, known) = unsafe { (object::<T>(plugin), OwnedKnown::read(&*known)?) };
        let own = known.with(|known| plugin.likelihood(known))?;
        // SAFETY: the caller gives a place for one likelihood.
        unsafe { *made = handed(own) };
        Ok(())
    })
}

/// Hands a likelihood over.
fn handed(own: Box<dyn plugin::Likelihood>) -> Likelihood {
    Likelihood {
        size: size_of::<Likelihood>(),
        likelihood: begin(Guest::new(own, fault())),
        functions: &raw const likelihood::FUNCTIONS,
    }
}

unsafe extern "C" fn likelihood_of_part<T: Discrepancy + Authored>(
    plugin: *mut c_void,
    known: *const Known,
    part: *const Known,
    made: *mut Likelihood,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `likelihood`; the part is there for the time of the call too.
        let (plugin, known, part) = unsafe {
            let (known, part) = (OwnedKnown::read(&*known)?, OwnedKnown::read(&*part)?);
            (object::<T>(plugin), known, part)
        };
        let own = known.with(|known| plugin.likelihood_of_part(known, part.data()))?;
        // SAFETY: the caller gives a place for one likelihood.
        unsafe { *made = handed(own.ok_or_else(Refusal::absent)?) };
        Ok(())
    })
}

unsafe extern "C" fn takes_stated_noise<T: Discrepancy + Authored>(
    plugin: *mut c_void,
    takes: *mut u8,
    answer: *const Answer,
) -> i32 {
    // SAFETY: the plugin that `create` made, and a place for one mark.
    unsafe { mark(takes, answer, || object::<T>(plugin).takes_stated_noise()) }
}

unsafe extern "C" fn stated_noise<T: Discrepancy + Authored>(
    plugin: *mut c_void,
    layout: Text,
    response: Numbers,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `likelihood`.
        let (plugin, layout, response) =
            unsafe { (object::<T>(plugin), layout.bytes(), response.slice()?) };
        let layout = serde_json::from_slice(layout)?;
        let noise = plugin.stated_noise(&layout, response).ok_or_else(Refusal::absent)?;
        out.row(&noise.sd);
        if let Some(times) = &noise.correlation_time {
            out.row(times);
        }
        Ok(())
    })
}

/// The rows of two matrices side by side, each made into a pair of rows.
fn row_by_row(
    first: &Matrix,
    second: &Matrix,
    pair: impl Fn(&[f64], &[f64]) -> (Vec<f64>, Vec<f64>),
) -> (Vec<f64>, Vec<f64>) {
    let (mut by_first, mut by_second) = (Vec::new(), Vec::new());
    for (a, b) in first.iter_rows().zip(second.iter_rows()) {
        let (x, y) = pair(a, b);
        by_first.extend(x);
        by_second.extend(y);
    }
    (by_first, by_second)
}
