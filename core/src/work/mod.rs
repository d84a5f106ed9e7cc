//! Runs that other processes make: what they are told, what they do, what they leave behind.
//!
//! Everything is a file under `campaign` in the folder of the runs. An *order* says what is to be run; it is all that a
//! process on another machine needs. That process notes each run that it begins, and for each that ends leaves a
//! *marker*: how it ended and the hash of its result. A marker is the truth about a run; what a scheduler knows
//! only explains why there is none.

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
pub use worker::{Assignment, hostname, work};

/// The folder of orders and markers in that of the runs.
pub fn folder(runs: &Path) -> PathBuf {
    runs.join("campaign")
}

/// The time in seconds since 1970 (UTC).
pub fn now() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |elapsed| elapsed.as_secs())
}
