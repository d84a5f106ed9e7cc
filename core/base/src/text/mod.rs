//! Text layer of a study: from TOML to values that know their place in the text, and back.
//!
//! [`mod@read`] parses text to nodes, [`mod@decode`] decodes nodes to types and reports every fault at its place as
//! [`Problems`]; [`emit`] writes types as TOML. [`values`], [`quantity`], [`file_name`], [`labels`] and [`response`]
//! are the types that sections share.

pub mod decode;
pub mod emit;
pub mod file_name;
pub mod labels;
pub mod memory;
pub mod nearest;
pub mod node;
pub mod problem;
pub mod quantity;
pub mod read;
pub mod response;
pub mod source;
pub mod values;

pub use decode::{decode, decode_beside};
pub use node::{Key, Node, Value};
pub use problem::{Complaints, Problem, Problems};
pub use source::{Place, SourceId, Sources};
