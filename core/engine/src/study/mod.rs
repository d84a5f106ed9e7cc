//! The study language: from TOML text to a study that can be run.

mod components;
mod context;
pub mod dependence;
pub mod derived;
pub mod fidelity;
pub mod field;
pub mod file;
pub mod forward;
pub mod gap;
pub mod hierarchy;
pub mod inherit;
pub mod inputs;
pub mod intervals;
pub mod language;
pub mod libraries;
pub mod noise;
pub mod overrides;
mod plain;
pub mod positions;
mod predict;
pub mod quantity;
pub mod reliability;
pub mod resolve;
mod resolved;
pub mod scenario;
pub mod schema;
mod sections;
pub mod sizes;
pub mod start;
pub mod table;
pub mod unknowns;

pub use plain::Study;
pub use resolve::Checked;
pub use table::Chosen;
