//! Distributions, streams of random numbers, moments of samples, optimisation, changes of coordinates.

pub mod distribution;
pub mod fit;
pub mod moments;
pub mod optimise;
pub mod random;
pub mod special;
pub mod transform;
