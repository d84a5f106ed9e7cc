//! Samplers: draws from a log density.

pub mod affine_invariant_ensemble;
