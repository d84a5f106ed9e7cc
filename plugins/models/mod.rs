//! Simulators a study can name.

pub mod equations;
pub mod mercury_target;
