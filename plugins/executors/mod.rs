//! Executors: where many model evaluations run.

pub mod local;
