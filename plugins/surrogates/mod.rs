//! Surrogates.

pub mod polynomial_chaos;
pub mod principal_components;
