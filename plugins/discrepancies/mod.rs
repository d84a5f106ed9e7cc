//! Discrepancies: the statistical model of what separates model and data.

pub mod autoregressive;
pub mod common;
pub mod gaussian;
pub mod gaussian_process;
pub mod multiplicative_gaussian;
pub mod student_t;

#[cfg(test)]
mod tests;
