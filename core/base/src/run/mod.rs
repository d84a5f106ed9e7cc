//! Reporting of a computation: progress, reasons to stop, faults of plugins; its files, and its independent tasks.

pub mod fault;
pub mod files;
pub mod progress;
pub mod stop;
pub mod tasks;

pub use fault::Fault;
pub use progress::{Listener, Observer, Progress, Silent};
pub use stop::Stop;
pub use tasks::Tasks;
