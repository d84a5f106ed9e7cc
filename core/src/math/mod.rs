//! Distributions, streams of random numbers, running moments.

pub mod distribution;
pub mod random;
