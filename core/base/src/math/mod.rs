//! Distributions and their dependence, random streams, Sobol' sequences, sample moments, changes of coordinates, log densities.

pub mod dependence;
pub mod distribution;
pub mod fit;
pub mod log_density;
pub mod moments;
pub mod random;
pub mod sobol;
pub mod special;
pub mod transform;

pub use log_density::Target;
