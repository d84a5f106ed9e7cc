//! The side of the library: tables of functions made from types that implement the traits.

mod component;
mod design;
mod discrepancy;
mod effect;
mod model;
mod reader;
mod sampler;
mod surrogate;
mod target;

pub use component::{Authored, Export};

use super::guard::guard_number;
use super::table::{Host, status};

/// Begins a library: its threads are as many as the program may have.
///
/// # Safety
/// The pointer is null or leads to a description of the program.
pub unsafe extern "C" fn start(host: *const Host) -> i32 {
    guard_number(status::PANIC, || {
        // SAFETY: as the caller promises.
        if let Some(host) = unsafe { host.as_ref() } {
            // A library has a pool of its own; that it is there already is no error.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(host.threads).build_global();
        }
        status::OK
    })
}
