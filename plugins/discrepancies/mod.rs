//! Discrepancies: statistical models of the difference between data and model.

pub mod approximate_bayesian_computation;
pub mod autoregressive;
pub mod common;
pub mod constrained_gaussian_process;
pub mod embedded;
pub mod gaussian;
pub mod gaussian_process;
pub mod multiplicative_gaussian;
pub mod pseudo_marginal;
pub mod scaled_gaussian_process;
pub mod student_t;
pub mod synthetic_likelihood;

#[cfg(test)]
mod tests;
