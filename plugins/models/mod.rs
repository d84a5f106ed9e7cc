//! Simulators a study can name.

pub mod mercury_target;
pub mod um_bridge;
