//! The components that a study can name: one folder a kind, one file a plugin.

pub mod designs;
pub mod discrepancies;
pub mod effects;
pub mod executors;
pub mod models;
pub mod readers;
pub mod samplers;
pub mod surrogates;
pub mod targets;
pub mod terms;
