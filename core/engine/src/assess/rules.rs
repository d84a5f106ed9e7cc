//! Descriptions of all checks, for the documentation.

use super::{
    bounds, chains, conditions, correlation, emulator, envelope, estimate, fit, influence,
    intervals, missing, modes, population, prior, replicates, residuals, runs, suspicious,
};

/// A type of finding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rule {
    /// Code in `summary.json`.
    pub code: &'static str,
    /// Quantity that the check examines.
    pub looks_at: String,
    /// Values from which on there is a note, a reservation, a failure.
    pub threshold: String,
    /// Importance of the finding, and source of the threshold.
    pub why: &'static str,
    /// Action that would help most.
    pub action: &'static str,
}

/// All types of findings, in the order in which a study meets them.
pub fn rules() -> Vec<Rule> {
    [
        runs::rules(),
        suspicious::rules(),
        replicates::rules(),
        envelope::rules(),
        chains::rules(),
        estimate::rules(),
        modes::rules(),
        bounds::rules(),
        prior::rules(),
        population::rules(),
        correlation::rules(),
        emulator::rules(),
        fit::rules(),
        residuals::rules(),
        influence::rules(),
        conditions::rules(),
        intervals::rules(),
        missing::rules(),
    ]
    .concat()
}
