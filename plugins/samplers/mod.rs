//! Samplers: draws from a log density.

pub mod affine_invariant_ensemble;
pub mod hamiltonian;
pub mod no_u_turn;
pub mod variational;
