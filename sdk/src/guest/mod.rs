//! The side of the library: tables of functions made from types that implement the traits.
#![allow(unsafe_code, reason = "the boundary to the program; each use says why it is sound")]

mod component;
mod design;
mod discrepancy;
mod effect;
mod model;
mod quantity;
mod reader;
mod sampler;
mod surrogate;
mod target;

use lacuna_abi::guard::guard_number;
use lacuna_abi::status;
use lacuna_abi::table::Host;

pub use component::Export;
use component::{Authored, Plugin};

/// A text of the program's, with a mark where it is not UTF-8.
fn text(bytes: &[u8]) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(bytes)
}

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
