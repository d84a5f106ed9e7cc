//! The declaration of a library: the one symbol that it exports.

use std::ffi::c_void;

use super::{ComponentFunctions, Text};

/// The first eight bytes of a declaration: `lacunapl` as a number.
pub const MAGIC: u64 = 0x6c61_6375_6e61_706c;
/// The version of the boundary: another one cannot be loaded.
pub const MAJOR: u32 = 1;
/// The minor version, raised by what is appended: a library may be older than the program, not newer.
pub const MINOR: u32 = 2;

record! {
    /// The program that loads a library.
    Host {
        /// The size of this struct in bytes.
        size: usize,
        /// The version of the boundary.
        major: u32,
        /// The minor version.
        minor: u32,
        /// The number of threads that a library may use for work of its own.
        threads: usize,
    }
}

record! {
    /// One plugin of a library.
    Entry {
        /// The size of this struct in bytes.
        size: usize,
        /// The kind, such as `sampler`.
        kind: Text,
        /// The name in a study.
        name: Text,
        /// The functions that plugins of all kinds have.
        component: *const ComponentFunctions,
        /// The functions of the kind: for a `sampler` a `SamplerFunctions`.
        functions: *const c_void,
    }
}

record! {
    /// The declaration of a library: the symbol `lacuna_plugin` that it exports. It is read before any of its code is
    /// called.
    Declaration {
        /// `LACUNA_MAGIC`.
        magic: u64,
        /// `LACUNA_MAJOR`.
        major: u32,
        /// `LACUNA_MINOR`.
        minor: u32,
        /// The size of this struct in bytes.
        size: usize,
        /// 1 where an error cannot end the whole process (a panic unwinds), 0 where it would.
        unwinds: u32,
        /// The number of entries.
        count: u32,
        /// The name of the library.
        name: Text,
        /// The version of the library.
        version: Text,
        /// With what it was made, such as `lacuna-plugin 0.1.0`.
        sdk: Text,
        /// The plugins.
        entries: *const Entry,
        /// The plain text by which `lacuna check` knows the library without loading it.
        record: Text,
        /// Called once when the library is loaded, before anything else; may be null.
        start: Option<unsafe extern "C" fn(host: *const Host) -> i32>,
    }
}

// SAFETY: the pointers lead to constants of the library, which is never unloaded.
unsafe impl Sync for Entry {}
// SAFETY: as for `Entry`.
unsafe impl Sync for Declaration {}
