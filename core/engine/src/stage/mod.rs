//! Stages, each a function from plain data to plain data; [`pipeline`](crate::pipeline) defines their order.

pub mod artifacts;
pub mod assess;
pub mod best_fit;
pub mod calibrate;
mod calls;
pub mod cases;
pub mod common_error;
pub mod contents;
pub mod curves;
pub mod derived;
pub mod design;
pub mod direct;
pub mod drawn;
pub mod emulated;
pub mod emulator_error;
pub mod energies;
pub mod evidence;
pub mod fidelity;
pub mod fields;
pub mod gradients;
pub mod grouped;
pub mod idle;
pub mod imports;
pub mod inference_data;
pub mod inverse_problem;
pub mod low_fidelity;
pub mod main_effects;
pub mod manifest;
pub mod mixing;
pub mod more_runs;
pub mod numerical_error;
pub mod pieces;
pub mod predict;
mod prediction_errors;
pub mod predictions;
pub mod quantities;
pub mod read;
pub mod refine;
pub mod reliability;
mod replicate_error;
pub mod results;
pub mod room;
pub mod sampling;
pub mod screen;
pub mod sequential;
pub mod simulate;
pub mod simulator;
mod start;
pub mod surrogate;
pub mod target;
pub mod validate;

use lacuna::math::random::Stream;

use crate::study::Study;

/// Random stream of a stage; the name must not change, so that existing runs can be reproduced.
pub fn stream(study: &Study, stage: &str) -> Stream {
    Stream::root(study.about.seed).named(stage)
}
