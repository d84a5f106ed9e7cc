//! Components that a study can choose by name: one folder per kind, one file or folder per plugin.

pub mod designs;
pub mod discrepancies;
pub mod effects;
pub mod executors;
pub mod models;
pub mod quantities;
pub mod readers;
pub mod reliability;
pub mod samplers;
pub mod surrogates;
pub mod targets;
pub mod terms;
