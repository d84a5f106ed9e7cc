//! Simulators that a study can choose by name.

pub mod composed;
pub mod equations;
pub mod external;
pub mod given;
pub mod mercury_target;
pub mod mercury_target_bubbles;
pub mod mercury_target_equilibrium_gas;
mod nested;
pub mod python;
pub mod um_bridge;
