//! Executors: where many model evaluations run.

mod amount;
mod cluster;
pub mod local;
mod program;
pub mod slurm;
