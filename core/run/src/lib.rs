//! Files of a run: artifacts with their provenance, its progress, arrays, and the orders and markers of runs that other processes
//! make.

mod adopt;
pub mod arrays;
pub mod directory;
mod growth;
pub mod made_by;
pub mod process;
pub mod progress;
mod provenance;
pub mod seen;
pub mod stage;
#[cfg(test)]
mod testing;
mod visit;
pub mod work;

pub use arrays::write_response;
pub use directory::{Artifact, Kept, RunDirectory, inputs_of};
pub use stage::{Folder, Stage};
