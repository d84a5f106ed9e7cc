//! Simulators a study can name.

pub mod external;
pub mod given;
pub mod mercury_target;
pub mod process;
pub mod python;
