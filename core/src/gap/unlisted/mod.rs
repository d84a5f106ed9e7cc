//! What is missing without a name: in words, and as a stopgap until it has one.

mod features;
mod process;
mod stopgap;
#[cfg(test)]
mod tests;
mod words;

pub use stopgap::{Curved, Stopgap, stopgap};
pub use words::{Dependence, Description, describe};
