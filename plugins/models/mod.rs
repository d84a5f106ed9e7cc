//! Simulators a study can name.

pub mod mercury_target;
