//! Base crate of plugins and engine: data, mathematics, expressions, convergence diagnostics, and the text of a study.
//!
//! Nothing here knows about plugins.

pub mod data;
pub mod diagnose;
pub mod expression;
pub mod math;
pub mod matrix;
pub mod run;
pub mod text;
