//! Gaussian processes of many runs: a likelihood of blocks of neighbours, and weights by conjugate gradients.

mod conditioning;
mod conjugate;
mod likelihood;
mod order;
mod precision;
mod tree;

#[cfg(test)]
mod tests;

pub use conditioning::{Conditioned, Near, Restored};
pub use likelihood::Nearby;
pub use order::Neighbours;
