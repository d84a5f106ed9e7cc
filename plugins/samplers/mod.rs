//! Samplers: draws from a log density.

mod adaptation;
pub mod adaptive_metropolis;
pub mod affine_invariant_ensemble;
mod archive;
mod chains;
pub mod delayed_rejection_adaptive_metropolis;
pub mod differential_evolution;
mod evaluated;
pub mod hamiltonian;
#[cfg(test)]
mod known_evidence;
pub mod metropolis;
mod moves;
pub mod nested;
pub mod no_u_turn;
pub mod parallel_tempering;
mod population;
mod proposal;
pub mod sequential_monte_carlo;
mod snooker;
pub mod transport;
#[cfg(test)]
mod truth;
pub mod variational;
