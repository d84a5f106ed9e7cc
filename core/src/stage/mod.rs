//! The whole program: stages in order, each one function from plain data to plain data.

pub mod calibrate;
pub mod common_error;
pub mod design;
pub mod inference_data;
pub mod manifest;
pub mod numerical_error;
pub mod read;
pub mod report;
pub mod results;
pub mod sampling;
pub mod screen;
pub mod simulate;
pub mod simulator;
pub mod surrogate;
pub mod validate;

use crate::math::random::Stream;
use crate::report::findings::Findings;
use crate::run::{Observer, RunDirectory, Stop};
use crate::study::Study;

/// Runs a study: what is kept and unchanged is taken, the rest is made.
pub fn run(
    study: &Study,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Findings, Stop> {
    manifest::begin(study, run)?;
    let design = design::stage(study, run, observer)?;
    let simulated = simulate::stage(study, design.as_ref(), run, observer)?;
    let data = read::stage(study, simulated.as_ref(), run, observer)?;
    let (fitted, emulator) = surrogate::stage(study, &data, run, observer)?;
    let numerics = numerical_error::stage(study, design.as_ref(), &data, run, observer)?;
    let (emulator, numerics) = (&*emulator, numerics.as_ref());
    let calibrated = calibrate::stage(study, &data, &fitted, numerics, emulator, run, observer)?;
    let calibrated = calibrated.as_ref();
    let validated =
        validate::stage(study, &data, &fitted, numerics, emulator, calibrated, run, observer)?;
    let validated = validated.as_ref();
    let all = report::Artifacts { data: &data, fitted: &fitted, emulator, calibrated, validated };
    let findings = report::stage(study, &all, run)?;
    manifest::end(study, run)?;
    Ok(findings)
}

/// The random stream of a stage.
fn stream(study: &Study, stage: &str) -> Stream {
    Stream::root(study.about.seed).named(stage)
}
