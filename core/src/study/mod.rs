//! The study language: from TOML text to decoded, checked options.

pub mod decode;
pub mod emit;
pub mod inherit;
pub mod nearest;
pub mod node;
pub mod overrides;
pub mod problem;
pub mod read;
pub mod schema;
pub mod source;
pub mod values;

pub use decode::{decode, decode_beside};
pub use node::{Key, Node, Value};
pub use problem::{Complaints, Problem, Problems};
pub use source::{Place, SourceId, Sources};
