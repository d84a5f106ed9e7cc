//! Numbers against truths that nobody here made: reference posteriors, closed forms, calibration by simulation.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "truth/calibration.rs"]
mod calibration;
#[path = "truth/emulated.rs"]
mod emulated;
#[path = "truth/posteriordb/mod.rs"]
mod posteriordb;
#[path = "truth/posteriors.rs"]
mod posteriors;
#[path = "truth/runs.rs"]
mod runs;

// Without this line the linker leaves the plugins out.
use lacuna_plugins as _;
