//! The whole program: stages in order, each one function from plain data to plain data.

pub mod design;
pub mod read;
pub mod results;
pub mod screen;
pub mod simulate;
pub mod simulator;
pub mod surrogate;

use crate::math::random::Stream;
use crate::study::Study;

/// The random stream of a stage.
fn stream(study: &Study, stage: &str) -> Stream {
    Stream::root(study.about.seed).named(stage)
}
