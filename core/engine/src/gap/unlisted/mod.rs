//! An unlisted effect, which no candidate explains: a description of its regions, a smoother in its place, and a
//! symbolic form that may become an effect.

mod dictionary;
mod features;
mod process;
pub(in crate::gap) mod selection;
mod smoother;
mod symbolic;
#[cfg(test)]
mod tests;
mod words;

pub use smoother::{SmoothedCurve, Smoother, smooth};
pub use symbolic::{Coefficient, Symbolic, SymbolicTerm, WrittenExpression, symbolic};
pub use words::{Dependence, ResidualDescription, describe};
