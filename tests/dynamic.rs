//! Plugins in loaded libraries: they give the same bits as linked plugins, and a broken library gives an error that
//! names it.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "dynamic/build.rs"]
mod build;
#[path = "dynamic/command.rs"]
mod command;
#[path = "dynamic/contracts.rs"]
mod contracts;
#[path = "dynamic/elsewhere.rs"]
mod elsewhere;
#[path = "dynamic/examples.rs"]
mod examples;
#[path = "dynamic/forwarded.rs"]
mod forwarded;
#[cfg(unix)]
#[path = "dynamic/hostile.rs"]
mod hostile;
#[cfg(unix)]
#[path = "dynamic/optional.rs"]
mod optional;
#[path = "dynamic/panics.rs"]
mod panics;
#[path = "quick.rs"]
#[allow(dead_code, reason = "other tests use the rest")]
mod quick;
#[path = "dynamic/script_time.rs"]
mod script_time;
#[path = "dynamic/scripts.rs"]
mod scripts;
#[path = "slurm/mod.rs"]
#[allow(dead_code, reason = "other tests use the rest")]
mod slurm;
#[path = "dynamic/studies.rs"]
mod studies;
#[cfg(unix)]
#[path = "dynamic/unruly.rs"]
mod unruly;
#[path = "dynamic/written.rs"]
mod written;

use std::path::PathBuf;
use std::sync::OnceLock;

use lacuna::plugin::Library;
use lacuna_engine::host::library;
// Without these lines the linker omits the plugins, and cargo the library.
use lacuna_plugins as _;
use lacuna_twin as _;

/// Path of the library of twins, which was built together with this test.
fn twin_path() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let prefix = std::env::consts::DLL_PREFIX;
    test.with_file_name(format!("{prefix}lacuna_twin{}", std::env::consts::DLL_SUFFIX))
}

/// The library of twins, loaded.
fn twin() -> &'static Library {
    static LOADED: OnceLock<&'static Library> = OnceLock::new();
    LOADED.get_or_init(|| library::load(&twin_path(), None).unwrap_or_else(|e| panic!("{e}")))
}
