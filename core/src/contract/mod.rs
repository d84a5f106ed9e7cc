//! What every plugin of a kind must do, as suites that any plugin can be put through.
//!
//! A suite gives every breach it finds in words; it never panics.

mod density;
mod design;
mod discrepancy;
mod effect;
mod executor;
mod judge;
mod model;
mod reader;
mod sampler;
mod surrogate;
mod term;

pub use density::density;
pub use design::design;
pub use discrepancy::discrepancy;
pub use effect::effect;
pub use executor::{LINE, Line, executor};
pub use model::model;
pub use reader::{Sample, reader};
pub use sampler::sampler;
pub use surrogate::surrogate;
pub use term::term;

#[cfg(test)]
mod tests;
