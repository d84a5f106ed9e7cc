//! An ensemble that takes months: what is known of its runs, and how it grows.
//!
//! All of it works from the run directory alone; no process needs to be running.

mod grow;
mod import;
mod show;
mod status;

pub use grow::{Grown, extend};
pub use import::{Imports, import};
pub use show::text;
pub use status::{Row, State, Status, cancel, status};

use crate::run::{Observer, RunDirectory, Stop};
use crate::stage::{design, simulate};
use crate::study::Study;

/// Makes the runs that are missing and those that failed, and nothing else; returns how many have failed.
pub fn retry(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<usize, Stop> {
    let placed = design::stage(study, run, observer)?;
    let made = simulate::stage(study, placed.as_ref(), run, observer)?;
    let made = made
        .ok_or_else(|| Stop::new("the study has no `[design]` and `[model]` to make runs with"))?;
    Ok(made.value.failures())
}
