//! What executors share that hand runs to a scheduler: submissions that are remembered, followed and repeated.
//!
//! All state is in the folder of the runs (`campaign`) and in the scheduler. The process that submits may be stopped at
//! any moment and another may go on days later.

pub mod cause;
mod follow;
mod ledger;
mod look;
mod pack;
pub mod scheduler;
pub mod script;

pub use cause::{Cause, Growth, Retry};
pub use follow::follow;
pub use ledger::Submission;
pub use look::{cancel, look};
pub use scheduler::{Plan, Scheduler, States, TaskState};
pub use script::{Frame, Worker};

use lacuna::study::values::{Count, Positive};

/// A number that is known to be a count, for defaults.
pub fn count(n: usize) -> Count {
    Count::new(n).unwrap_or_else(|_| unreachable!("{n} is 1 or more"))
}

/// A number that is known to be positive, for defaults.
pub fn positive(x: f64) -> Positive {
    Positive::new(x).unwrap_or_else(|_| unreachable!("{x} is positive"))
}
