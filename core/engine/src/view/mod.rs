//! Run directories as pages and JSON, for `lacuna view`: which runs there are, how far an unfinished one is, results of
//! finished ones, comparisons.
//!
//! Everything is read from the files of a run, while another process may be writing them: nothing is locked, written or
//! computed anew, and no plugin is loaded.

mod address;
mod answer;
mod campaign;
mod folder;
mod gap;
mod pages;
mod row;
mod sampling;
#[cfg(test)]
mod tests;
mod watched;

pub use answer::Answer;
pub use campaign::{CampaignCounts, CampaignTable};
pub use folder::ServedFolder;
pub use gap::{GapProgress, GapState};
pub use row::{Estimate, RunRow, RunState};
pub use sampling::{RunningCoordinate, Sampling};
pub use watched::{SCHEMA, StageRow, Watched};
