//! Distributions, streams of random numbers, moments of samples, optimisation.

pub mod distribution;
pub mod random;
pub mod special;
