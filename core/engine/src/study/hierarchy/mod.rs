//! Parameters that have a value for each group, such as each target or each batch, and the populations of these values.
//!
//! ```text
//! keys     the keys of [[parameter]] as written
//! groups   scenarios from a column of the measurements
//! members  the parameters and unknowns that they stand for, and the distribution of a member by itself
//! pools    populations of unknowns of the discrepancy and of effects
//! trained  the study whose runs train the emulator: one value of each parameter, conditions that differ once
//! check    combinations that are refused
//! ```

mod check;
mod groups;
mod keys;
mod members;
mod pools;
mod trained;

use super::file::ParameterSection;

pub(super) use check::{check, of_effect, of_sections};
pub(super) use groups::groups_as_scenarios;
pub use keys::{CoordinatesKey, PopulationKeys, ScatterKeys};
pub(super) use members::members;
pub use pools::{Pool, populations, unknowns};
pub(super) use trained::trained;
pub use trained::{Part, Trained};

/// Parameters by group of a study.
#[derive(Default)]
pub struct Hierarchy {
    /// The parameters with `by`, as written.
    pub sections: Vec<ParameterSection>,
    /// The study whose runs train the emulator, if it is another than the study itself.
    pub trained: Option<Trained>,
}

impl Hierarchy {
    /// Those of some parameters that have groups.
    pub(super) fn of(mut sections: Vec<ParameterSection>) -> Self {
        sections.retain(|section| section.by.is_some());
        Self { sections, trained: None }
    }
}

/// Group to which a member belongs.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Member {
    /// Label by which the groups are made, such as `target`; `scenario` for the scenarios themselves.
    pub by: String,
    /// Name of the group, such as `T24`.
    pub group: String,
    /// Indices of its scenarios.
    pub scenarios: Vec<usize>,
}
