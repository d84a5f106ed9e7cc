//! Reliability methods: probabilities of rare events.

pub mod active_kriging;
mod common;
pub mod form;
pub mod importance_sampling;
pub mod monte_carlo;
pub mod sorm;
pub mod subset_simulation;

#[cfg(test)]
mod tests;
