//! Structured data as JSON: what does not cross the boundary as numbers.

mod complaint;
mod context;
mod data;
mod harvest;
mod options;

pub use complaint::Complaint;
pub use context::OwnedContext;
pub use data::DataAbout;
pub use harvest::HarvestAbout;
pub use options::{json_of_node, json_of_table, node_of_json, table_of_json};
