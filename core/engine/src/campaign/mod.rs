//! Management of ensembles that take months: status and extension of their runs.
//!
//! Everything works from the run directory alone; no process needs to be running.

mod grow;
mod import;
mod show;
mod status;

use lacuna::run::{Observer, Stop};
use lacuna_run::RunDirectory;

use crate::stage::{design, simulate};
use crate::study::Study;

pub use grow::{Grown, extend};
pub use import::{Imports, import};
pub use show::text;
pub use status::{Row, State, Status, cancel, has_runs, status, status_on_disk};

/// Makes missing runs and repeats failed ones, and nothing else; returns the number of failed runs.
pub fn retry(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<usize, Stop> {
    let study = study.trained();
    let placed = design::stage(study, run, observer)?;
    let made = simulate::stage(study, placed.as_ref(), run, observer)?;
    let made = made
        .ok_or_else(|| Stop::new("the study has no `[design]` and `[model]` to make runs with"))?;
    Ok(made.value.failures())
}
