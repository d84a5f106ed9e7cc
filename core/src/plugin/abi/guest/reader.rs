//! Readers of a library.

use std::ffi::c_void;
use std::path::Path;

use super::component::{Authored, Components, Export};
use crate::linalg::Matrix;
use crate::plugin::Reader;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{Out, fill, guard, guard_number, object};
use crate::plugin::abi::table::{Answer, ComponentFunctions, ReaderFunctions, Text};
use crate::plugin::abi::wire::{ContentsAbout, EnsembleAbout, MeasuredAbout, OwnedSource};

impl<T: Reader + Authored, const REVISION: u32> Export<T, REVISION> for dyn Reader {
    const FUNCTIONS: *const c_void = std::ptr::from_ref(Functions::<T>::TABLE).cast();
    const COMPONENT: *const ComponentFunctions = Components::<T, REVISION>::FUNCTIONS;
}

struct Functions<T>(std::marker::PhantomData<T>);

impl<T: Reader + Authored> Functions<T> {
    const TABLE: &'static ReaderFunctions = &ReaderFunctions {
        size: size_of::<ReaderFunctions>(),
        recognises: Some(recognises::<T>),
        inspect: Some(inspect::<T>),
        names_files: Some(names_files::<T>),
        files: Some(files::<T>),
        ensemble: Some(ensemble::<T>),
        measurements: Some(measurements::<T>),
        grid: Some(grid::<T>),
        response: Some(response::<T>),
        allowed_failures: Some(allowed_failures::<T>),
    };
}

/// Answers something about a source.
///
/// # Safety
/// The plugin is one that `create` made, and the text is there.
unsafe fn of_source<T: Reader + Authored>(
    plugin: *mut c_void,
    source: Text,
    answer: *const Answer,
    tell: impl FnOnce(&T, &OwnedSource, &Out) -> Result<(), Refusal>,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as the caller promises.
        let (plugin, source) = unsafe { (object::<T>(plugin), source.bytes()) };
        tell(plugin, &serde_json::from_slice(source)?, out)
    })
}

fn incomplete() -> Refusal {
    Refusal::stop("the source is not complete")
}

unsafe extern "C" fn recognises<T: Reader + Authored>(
    plugin: *mut c_void,
    path: Text,
    head: Text,
) -> i32 {
    guard_number(0, || {
        // SAFETY: the plugin that `create` made; the texts are there for the time of the call.
        let (plugin, path, head) = unsafe { (object::<T>(plugin), path.string(), head.bytes()) };
        i32::from(plugin.recognises(Path::new(&path), head))
    })
}

unsafe extern "C" fn inspect<T: Reader + Authored>(
    plugin: *mut c_void,
    path: Text,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `recognises`.
        let (plugin, path) = unsafe { (object::<T>(plugin), path.string()) };
        let (about, matrices) = ContentsAbout::take_apart(plugin.inspect(Path::new(&path))?);
        for matrix in &matrices {
            out.numbers(matrix);
        }
        out.json(&about)
    })
}

unsafe extern "C" fn names_files<T: Reader + Authored>(plugin: *mut c_void) -> i32 {
    // SAFETY: the plugin that `create` made.
    guard_number(0, || i32::from(unsafe { object::<T>(plugin) }.names_files()))
}

unsafe extern "C" fn files<T: Reader + Authored>(
    plugin: *mut c_void,
    source: Text,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe {
        of_source::<T>(plugin, source, answer, |plugin, source, out| {
            out.json(&plugin.files(&source.directory, source.scenario.as_deref()))
        })
    }
}

unsafe extern "C" fn ensemble<T: Reader + Authored>(
    plugin: *mut c_void,
    source: Text,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe {
        of_source::<T>(plugin, source, answer, |plugin, source, out| {
            let read = plugin.ensemble(&source.ensemble().ok_or_else(incomplete)?)?;
            out.numbers(&read.points);
            out.numbers(&read.responses);
            out.json(&EnsembleAbout { runs: read.runs, valid: read.valid, failed: read.failed })
        })
    }
}

unsafe extern "C" fn measurements<T: Reader + Authored>(
    plugin: *mut c_void,
    source: Text,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe {
        of_source::<T>(plugin, source, answer, |plugin, source, out| {
            let read = plugin.measurements(&source.measurements().ok_or_else(incomplete)?)?;
            let rows = read.replicates.iter().map(|replicate| {
                replicate.values.iter().map(|value| value.unwrap_or(f64::NAN)).collect::<Vec<f64>>()
            });
            out.numbers(&Matrix::from_rows(read.layout.len(), rows));
            let about = MeasuredAbout::of(&read);
            if matches!(about, MeasuredAbout::Stated { sd: true, .. }) {
                let none = || vec![f64::NAN; read.layout.len()];
                let sd = read.replicates.iter().map(|r| r.sd.clone().unwrap_or_else(none));
                out.numbers(&Matrix::from_rows(read.layout.len(), sd));
            }
            read.covariance.iter().for_each(|covariance| out.numbers(covariance));
            out.json(&about)
        })
    }
}

unsafe extern "C" fn grid<T: Reader + Authored>(
    plugin: *mut c_void,
    source: Text,
    answer: *const Answer,
) -> i32 {
    // SAFETY: as this function's caller promises.
    unsafe {
        of_source::<T>(plugin, source, answer, |plugin, source, out| {
            out.row(&plugin.grid(&source.grid().ok_or_else(incomplete)?)?);
            Ok(())
        })
    }
}

unsafe extern "C" fn response<T: Reader + Authored>(
    plugin: *mut c_void,
    path: Text,
    layout: Text,
    outputs: usize,
    values: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `recognises`.
        let (plugin, path, layout) =
            unsafe { (object::<T>(plugin), path.string(), layout.bytes()) };
        let response = plugin.response(Path::new(&path), &serde_json::from_slice(layout)?)?;
        // SAFETY: the buffer holds one number an output.
        unsafe { fill(values, outputs, &response) }
    })
}

unsafe extern "C" fn allowed_failures<T: Reader + Authored>(
    plugin: *mut c_void,
    runs: usize,
    allowed: *mut usize,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: the plugin that `create` made.
        let plugin = unsafe { object::<T>(plugin) };
        let count = plugin.allowed_failures(runs).ok_or_else(Refusal::absent)?;
        // SAFETY: the caller gives a place for one number.
        unsafe { *allowed = count };
        Ok(())
    })
}
