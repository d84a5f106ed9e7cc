//! Whether a result can be trusted: checks from plain figures to findings, and the verdict over all of them.
//!
//! A check looks at numbers and knows no study, file or plugin; `stage::assess` gathers the numbers. Each
//! module holds the checks of one subject with their thresholds and says in [`rules`] what it looks at.

pub mod bounds;
pub mod chains;
pub mod correlation;
pub mod emulator;
pub mod envelope;
mod finding;
pub mod fit;
pub mod influence;
pub mod modes;
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
