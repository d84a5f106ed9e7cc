//! Runs that other processes make: their orders, their work, their results.
//!
//! Everything is a file under `campaign` in the folder of the runs. An *order* states what is to be run; it is all that
//! a process on another machine needs. That process records each run that it begins, and for each that ends writes a
//! *marker*: how it ended and the hash of its result. The marker is authoritative; information from a scheduler only
//! explains why there is none.

mod evaluate;
mod limits;
mod marker;
mod memory;
mod order;
mod worker;

use std::path::{Path, PathBuf};

pub use evaluate::{Ended, evaluate};
pub use limits::Limits;
pub use marker::{Begun, Marker, Outcome};
pub use order::Order;
pub use worker::{Assignment, Then, WithModel, hostname, work};

/// Folder of orders and markers inside the folder of the runs.
pub fn folder(runs: &Path) -> PathBuf {
    runs.join("campaign")
}

/// Present time, in seconds since 1970 (UTC).
pub fn now() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |elapsed| elapsed.as_secs())
}
