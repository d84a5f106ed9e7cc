//! Results compared with independent truths: reference posteriors, closed forms, simulation-based calibration.

mod calibration;
mod emulated;
mod posteriors;
mod runs;
