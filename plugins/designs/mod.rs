//! Designs: where the simulator is run.

pub mod latin_hypercube;
pub mod quadrature;
pub mod random;
pub mod sobol;
