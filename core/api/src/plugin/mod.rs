//! Interfaces of plugins: one trait per file, in the order in which a study uses them.
//!
//! A plugin is a struct of options that deserialises from its section of the study and implements the trait of its
//! kind; one `register!` line at the end of its file adds it to the registry.

pub mod amend;
pub mod component;
pub mod density;
pub mod design;
pub mod discrepancy;
pub mod effect;
pub mod executor;
pub mod forward;
pub mod identity;
mod kinds;
pub mod library;
pub mod manual;
pub mod model;
pub mod quantity;
pub mod reader;
pub mod registry;
pub mod reliability;
pub mod sampler;
pub mod schema;
pub mod surrogate;
pub mod term;

pub use amend::Amend;
pub use component::{Component, Context, Fact, Given, Size};
pub use density::Density;
pub use design::Design;
pub use discrepancy::{Discrepancy, Hyperparameter, Likelihood};
pub use effect::Effect;
pub use executor::Executor;
pub use forward::Forward;
pub use library::Library;
pub use model::{EvalError, Model};
pub use quantity::Quantity;
pub use reader::Reader;
pub use reliability::Reliability;
pub use sampler::{Sampler, Target};
pub use surrogate::{Emulator, Sensitivity, Surrogate};
pub use term::Term;
