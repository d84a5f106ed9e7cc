//! Samplers: draws from a log density.

mod adaptation;
pub mod adaptive_metropolis;
pub mod affine_invariant_ensemble;
mod archive;
mod chains;
pub mod delayed_rejection_adaptive_metropolis;
pub mod differential_evolution;
pub mod hamiltonian;
pub mod metropolis;
pub mod no_u_turn;
mod proposal;
mod snooker;
#[cfg(test)]
mod truth;
pub mod variational;
mod evaluated;
mod known_evidence;
mod moves;
pub mod nested;
pub mod sequential_monte_carlo;
