//! The crate that plugins are written against: the traits of the kinds, the registry, and the basic types.
//!
//! A plugin depends on this crate and on nothing above it. The re-exports from `lacuna-base` (data, mathematics,
//! expressions, the text of a study) are part of it.

pub mod plugin;

pub use lacuna_base::{data, diagnose, expression, math, matrix, run, text};
