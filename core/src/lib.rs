//! Lacuna closes the gap between simulation and measurement.
//!
//! This crate is the engine: it reads a *study* (one TOML file), runs its stages from plain data to
//! plain data, keeps every artifact, and names no plugin. Plugins register themselves
//! (see [`plugin::registry`]); the binary links the crate that holds them.

pub mod assess;
pub mod campaign;
pub mod compare;
pub mod contract;
pub mod data;
pub mod diagnose;
pub mod expression;
pub mod gap;
pub mod math;
pub mod plugin;
pub mod posterior;
pub mod report;
pub mod run;
pub mod serve;
pub mod stage;
pub mod study;
pub mod work;

pub use lacuna_linalg as linalg;
