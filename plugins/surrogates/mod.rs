//! Surrogates: emulators fitted to simulation runs.

pub mod gaussian_process;
pub mod kriging;
pub mod polynomial_chaos;
pub mod polynomial_chaos_kriging;
pub mod principal_components;
