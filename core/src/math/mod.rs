//! Distributions, streams of random numbers, moments of samples, optimisation.

pub mod distribution;
pub mod fit;
pub mod moments;
pub mod optimise;
pub mod random;
pub mod special;
