//! The study language.
pub mod problem;
