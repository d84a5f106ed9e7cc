//! Targets: log densities without data and surrogate.

pub mod expression;
