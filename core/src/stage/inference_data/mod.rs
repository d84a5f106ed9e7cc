//! `posterior.nc`: the draws and what they predict as a NetCDF-4 file in the layout of ArviZ's `InferenceData`.
//!
//! Groups and names are those of the ArviZ schema (`InferenceData` schema, version 1). The date of creation that ArviZ
//! writes is left out: the file depends on the study alone, and `manifest.json` has the times.

mod cells;
mod file;
mod groups;
mod predicted;

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::posterior::Posterior;
use crate::run::{Kept, RunDirectory, Stop, files};
use crate::study::Study;

use super::calibrate::{Calibrated, Law, Parts};
use super::evidence::Weighed;
use super::predictions::Predicting;
use super::validate::Validated;
use super::{Known, derived};
use predicted::Predictor;

/// The file, in the run directory.
const NAME: &str = "posterior.nc";

/// What it was made of, in the folder of the report.
const MARKER: &str = "posterior.json";

/// To be raised when the same artifacts give another file.
const REVISION: u32 = 2;

/// What a file was made of.
#[derive(PartialEq, Serialize, Deserialize)]
struct Marker {
    /// The hash of all that went into it.
    inputs: String,
    /// Its own hash.
    file: String,
}

/// The artifacts that go into the file.
#[derive(Clone, Copy)]
pub struct Finished<'a> {
    /// The posterior.
    pub calibrated: &'a Kept<Calibrated>,
    /// What speaks for the study as a whole.
    pub weighed: Option<&'a Kept<Weighed>>,
    /// The calibrated model against the data.
    pub validated: Option<&'a Kept<Validated>>,
}

/// Writes the file of a study with data.
pub fn stage(
    study: &Study,
    known: &Known<'_>,
    all: &Finished<'_>,
    run: &RunDirectory,
) -> Result<(), Stop> {
    let Some(measured) = &known.data.value.measured else { return Ok(()) };
    write(study, all, run, || {
        let parts = Parts::of(study, measured, known)?;
        let predictive = Parts::predicting(study, measured, known)?;
        let posterior = parts.posterior(study, known);
        let predicting = Predicting {
            forward: known.forward,
            likelihood: parts.likelihood(),
            law: Law::of(study, measured, known)?,
            data: &measured.likelihood,
        };
        let makes = predictive.likelihood();
        encode(study, all, &posterior, Some(&Predictor { densities: predicting, makes }))
    })
}

/// Writes the file of a study of a density that is given.
pub fn of_target(
    study: &Study,
    posterior: &Posterior<'_>,
    all: &Finished<'_>,
    run: &RunDirectory,
) -> Result<(), Stop> {
    write(study, all, run, || encode(study, all, posterior, None))
}

fn write(
    study: &Study,
    all: &Finished<'_>,
    run: &RunDirectory,
    make: impl FnOnce() -> Result<Vec<u8>, Stop>,
) -> Result<(), Stop> {
    let inputs = json!([
        REVISION,
        env!("CARGO_PKG_VERSION"),
        all.calibrated.hash,
        all.weighed.map(|kept| &kept.hash),
        all.validated.map(|kept| &kept.hash),
        study.about.title,
        study.derived_sections,
        study.scenarios,
        study.parameters.iter().map(|p| p.reference).collect::<Vec<_>>(),
    ]);
    let path = run.root().join(NAME);
    let marker = run.stage_folder("8-report").join(MARKER);
    let inputs = files::hash(inputs.to_string().as_bytes());
    let current = |known: Marker| {
        known.inputs == inputs && files::hash_file(&path).is_ok_and(|hash| hash == known.file)
    };
    // Predictions may take long, and the file may be large: what is there and unchanged stays.
    if files::read_json(&marker).is_ok_and(current) {
        return Ok(());
    }
    let bytes = make()?;
    files::write_atomic(&path, &bytes)?;
    files::write_json(&marker, &Marker { inputs, file: files::hash(&bytes) })
}

/// The bytes of the file.
fn encode(
    study: &Study,
    all: &Finished<'_>,
    posterior: &Posterior<'_>,
    predictor: Option<&Predictor<'_>>,
) -> Result<Vec<u8>, Stop> {
    let calibrated = &all.calibrated.value;
    let given = groups::Given {
        study,
        calibrated: &derived::extended(study, calibrated),
        weighed: all.weighed.map(|kept| &kept.value),
        validated: all.validated.map(|kept| &kept.value),
        data: predictor.map(|p| p.densities.data),
        from_posterior: match predictor {
            Some(p) => predicted::from_posterior(study, p, calibrated)?,
            None => None,
        },
        from_prior: predicted::from_prior(study, posterior, predictor)?,
    };
    given.encode().map_err(|error| Stop::new(format!("cannot write {NAME}: {error}")))
}

/// What tells the blocks of scenarios apart in names: nothing where there is one.
fn suffix(block: usize, blocks: usize) -> String {
    if blocks == 1 { String::new() } else { format!("_{}", block + 1) }
}
