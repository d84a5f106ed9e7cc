//! The keys of the companion.

use schemars::JsonSchema;
use serde::Serialize;

use crate::gap::result::companion::IdentifiedCompanion;
use crate::report::summary::value::Quantity;

/// Companion of the study's simulator, with its errors on simulation runs that did not identify its constants.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Companion {
    /// True if candidates act inside it: its error is at most `gate` of `[gap.companion]`.
    pub used: bool,
    /// Root mean square error on the runs, divided by the root mean square of the response about its mean.
    pub error: Quantity,
    /// Root mean square error of changes between runs, divided by the root mean square change: the relative error of the size
    /// of a candidate.
    pub error_of_changes: Quantity,
    /// Number of runs on which it was checked.
    pub runs: usize,
}

impl Companion {
    pub fn of(found: &IdentifiedCompanion) -> Self {
        Self {
            used: found.admitted,
            error: found.error.into(),
            error_of_changes: found.of_changes.into(),
            runs: found.checked,
        }
    }
}
