//! Lacuna closes the gap between simulation and measurement.
//!
//! This crate is the engine: it reads a *study* (one TOML file), runs its stages from plain data to plain data, keeps
//! every artifact, and names no plugin. Plugins register themselves (see [`lacuna::plugin::registry`]); the binary
//! links the crate that contains them.

pub mod assess;
pub mod augment;
pub mod campaign;
pub mod compare;
pub mod coverage;
pub mod extremes;
pub mod gap;
pub mod host;
pub mod page;
pub mod pipeline;
pub mod posterior;
pub mod report;
pub mod screening;
pub mod sensitivity;
pub mod serve;
pub mod stage;
pub mod study;
pub mod view;
pub mod work;
