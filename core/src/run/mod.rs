//! The run directory: artifacts, checkpoints, manifest, progress.

mod adopt;
pub mod arrays;
pub mod directory;
pub mod files;
mod growth;
pub mod made_by;
pub mod progress;
mod provenance;
pub mod stop;

pub use arrays::write_response;
pub use directory::{Artifact, Kept, RunDirectory, inputs_of};
pub use progress::{Listener, Observer, Progress, Silent};
pub use stop::Stop;
