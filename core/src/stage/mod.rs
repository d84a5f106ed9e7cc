//! The whole program: stages in order, each one function from plain data to plain data.

pub mod best_fit;
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
use crate::plugin::Emulator;
use crate::report::findings::Findings;
use crate::run::{Kept, Observer, RunDirectory, Stop};
use crate::study::Study;

use numerical_error::NumericalError;
use read::Data;
use surrogate::Fitted;

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
    let known =
        Known { data: &data, fitted: &fitted, numerics: numerics.as_ref(), emulator: &*emulator };
    let calibrated = calibrate::stage(study, &known, run, observer)?;
    let validated = validate::stage(study, &known, calibrated.as_ref(), run, observer)?;
    let findings = report::stage(study, &known, calibrated.as_ref(), validated.as_ref(), run)?;
    manifest::end(study, run)?;
    Ok(findings)
}

/// What is known before the posterior: the data, the emulator and its errors.
pub struct Known<'a> {
    /// The runs and the measurements.
    pub data: &'a Kept<Data>,
    /// The fitted surrogate with its errors.
    pub fitted: &'a Kept<Fitted>,
    /// The model's numerical error, if the study asks for it.
    pub numerics: Option<&'a Kept<NumericalError>>,
    /// The emulator.
    pub emulator: &'a dyn Emulator,
}

/// The random stream of a stage.
fn stream(study: &Study, stage: &str) -> Stream {
    Stream::root(study.about.seed).named(stage)
}
