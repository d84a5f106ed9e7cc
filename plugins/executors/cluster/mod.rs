//! Parts shared by the executors that use a scheduler: submissions that are recorded, followed and repeated.
//!
//! All state is in the folder of the runs (`campaign`) and in the scheduler. The submitting process may be stopped at
//! any moment, and another one may continue days later.

pub mod cause;
mod follow;
mod ledger;
mod look;
mod pack;
pub mod scheduler;
pub mod script;

use lacuna::text::values::{Count, Positive};

pub use cause::{Cause, Growth, Retry};
pub use follow::follow;
pub use ledger::Submission;
pub use look::{cancel, look};
pub use scheduler::{Plan, Scheduler, States, TaskState};
pub use script::{Frame, Worker};

/// Builds a [`Count`] for a default, from a number known to be at least 1.
pub fn count(n: usize) -> Count {
    Count::new(n).unwrap_or_else(|_| unreachable!("{n} is 1 or more"))
}

/// Builds a [`Positive`] for a default, from a number known to be above 0.
pub fn positive(x: f64) -> Positive {
    Positive::new(x).unwrap_or_else(|_| unreachable!("{x} is positive"))
}
