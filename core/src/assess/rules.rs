//! What every check looks at, for the documentation.

use super::{
    bounds, chains, correlation, emulator, envelope, fit, influence, modes, prior, replicates,
    residuals, runs, suspicious,
};

/// A kind of finding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rule {
    /// Its code in `summary.json`.
    pub code: &'static str,
    /// The figure.
    pub looks_at: String,
    /// From which figure on it is a note, a reservation, a failure.
    pub threshold: String,
    /// Why it matters, and where the threshold comes from.
    pub why: &'static str,
    /// What would help most.
    pub action: &'static str,
}

/// All kinds of findings, in the order in which a study meets them.
pub fn rules() -> Vec<Rule> {
    [
        runs::rules(),
        suspicious::rules(),
        replicates::rules(),
        envelope::rules(),
        chains::rules(),
        modes::rules(),
        bounds::rules(),
        prior::rules(),
        correlation::rules(),
        emulator::rules(),
        fit::rules(),
        residuals::rules(),
        influence::rules(),
    ]
    .concat()
}
