//! Verdict on a result: checks that turn plain numbers into findings, and the verdict over all findings.
//!
//! A check uses numbers only and depends on no study, file or plugin; `stage::assess` collects the numbers. Each module
//! contains the checks of one subject with their thresholds, and describes them in [`rules`].

pub mod bounds;
pub mod chains;
pub mod conditions;
pub mod correlation;
pub mod emulator;
pub mod envelope;
pub mod estimate;
mod finding;
pub mod fit;
pub mod influence;
pub mod intervals;
pub mod missing;
pub mod modes;
pub mod population;
pub mod prior;
pub mod replicates;
pub mod residuals;
mod rules;
pub mod runs;
pub mod suspicious;
mod words;

pub use finding::{Assessment, Finding, Level, Severity};
pub use rules::{Rule, rules};

#[cfg(test)]
mod tests;
