//! The run directory: artifacts, checkpoints, manifest, progress.

pub mod progress;
pub mod stop;

pub use progress::{Observer, Progress, Silent};
pub use stop::Stop;
