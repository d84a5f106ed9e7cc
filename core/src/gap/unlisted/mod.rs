//! What is missing without a name: in words, and as a stopgap until it has one, and as a form that may become
//! one.

mod dictionary;
mod features;
mod process;
mod selection;
mod stopgap;
mod symbolic;
#[cfg(test)]
mod tests;
mod words;

pub use stopgap::{Curved, Stopgap, stopgap};
pub use symbolic::{Coefficient, Symbolic, Term, Written, symbolic};
pub use words::{Dependence, Description, describe};
