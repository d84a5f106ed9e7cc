//! The study language: from TOML text to a study that can be run.

pub mod components;
mod context;
pub mod decode;
pub mod derived;
pub mod emit;
pub mod fidelity;
pub mod file;
pub mod file_name;
pub mod gap;
pub mod inherit;
pub mod inputs;
pub mod language;
pub mod libraries;
pub mod nearest;
pub mod node;
pub mod overrides;
pub mod problem;
pub mod quantity;
pub mod read;
pub mod resolve;
mod resolved;
pub mod response;
pub mod scenario;
pub mod schema;
mod sections;
mod sizes;
pub mod source;
pub mod unknowns;
pub mod values;

pub use components::Chosen;
pub use decode::{decode, decode_beside};
pub use node::{Key, Node, Value};
pub use problem::{Complaints, Problem, Problems};
pub use resolve::{Checked, Study};
pub use source::{Place, SourceId, Sources};
