//! Tests of the expansion against closed forms, slow textbook code, and figures measured elsewhere.
#![allow(clippy::unwrap_used)]

mod accuracy;
mod behaviour;
mod bench;
mod components;
mod families;
pub mod functions;
mod gradients;
mod laws;
mod many_inputs;
mod many_runs;
mod options;
mod paths;
mod solvers;
mod textbook;
