//! Surrogates.

pub mod polynomial_chaos;
