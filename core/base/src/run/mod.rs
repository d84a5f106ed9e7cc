//! Reporting of a computation: progress, reasons to stop, faults of plugins; and its files.

pub mod fault;
pub mod files;
pub mod progress;
pub mod stop;

pub use fault::Fault;
pub use progress::{Listener, Observer, Progress, Silent};
pub use stop::Stop;
