//! Executors: the machines on which model evaluations run.

mod amount;
mod cluster;
mod command;
pub mod hyperqueue;
pub mod local;
mod program;
pub mod slurm;
