//! Contracts of the kinds of plugins, as test suites that any plugin can be run through.
//!
//! A suite returns a description of every violation that it finds; it never panics.

mod density;
mod design;
mod discrepancy;
mod effect;
#[cfg(feature = "executor")]
mod executor;
mod judge;
mod model;
mod quantity;
mod reader;
mod reliability;
mod sampler;
mod surrogate;
mod term;

pub use density::density;
pub use design::design;
pub use discrepancy::discrepancy;
pub use effect::effect;
#[cfg(feature = "executor")]
pub use executor::{LINE, Line, executor};
pub use model::model;
pub use quantity::quantity;
pub use reader::{Sample, reader};
pub use reliability::reliability;
pub use sampler::sampler;
pub use surrogate::surrogate;
pub use term::term;

#[cfg(test)]
mod tests;
