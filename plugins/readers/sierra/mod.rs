//! Sierra's output: Exodus II results and history files, and heartbeat text.

pub mod container;
pub mod exodus;
pub mod heartbeat;
pub mod locate;
pub mod parts;
pub mod probe;
pub mod signal;
pub mod write;

#[cfg(test)]
mod tests;
