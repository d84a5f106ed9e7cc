//! Samplers: draws from a log density.

pub mod affine_invariant_ensemble;
mod evaluated;
#[cfg(test)]
mod known_evidence;
mod moves;
pub mod nested;
pub mod sequential_monte_carlo;
