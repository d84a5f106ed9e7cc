//! `posterior.nc`: the draws and their predictions as a NetCDF-4 file in the layout of ArviZ's `InferenceData`.
//!
//! Groups and names are those of the ArviZ schema (`InferenceData` schema, version 1). The creation date that ArviZ
//! writes is omitted: the file depends on the study alone, and `manifest.json` has the times.

mod cells;
mod file;
mod groups;
mod predicted;

use lacuna::data::Observations;
use lacuna::run::{Stop, files};
use lacuna_run::{Kept, RunDirectory, Stage};
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::file::File;
use super::calibrate::{Calibrated, Law, Parts};
use super::derived;
use super::evidence::Weighed;
use super::predictions::{self, Predicting, Predictor};
use super::quantities::Quantified;
use super::validate::Validated;
use crate::posterior::Posterior;
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

/// Name of the file in the run directory.
const NAME: &str = "posterior.nc";

/// Name of the file, in the folder of the report, that records its inputs.
const MARKER: &str = "posterior.json";

/// Revision, raised when the same artifacts give another file.
const REVISION: u32 = 2;

/// Record of a file's inputs.
#[derive(PartialEq, Serialize, Deserialize)]
struct Marker {
    /// Hash of all inputs.
    inputs: String,
    /// Hash of the file itself.
    file: String,
}

/// Artifacts that enter the file.
#[derive(Clone, Copy)]
pub struct Finished<'a> {
    /// Posterior.
    pub calibrated: &'a Kept<Calibrated>,
    /// Evidence and predictive measures of the study.
    pub weighed: Option<&'a Kept<Weighed>>,
    /// Comparison of the calibrated model with the data.
    pub validated: Option<&'a Kept<Validated>>,
    /// Predicted quantities.
    pub quantities: Option<&'a Kept<Quantified>>,
}

/// Writes the file of a study with data.
pub fn stage(
    study: &Study,
    problem: &InverseProblem<'_>,
    all: &Finished<'_>,
    run: &RunDirectory,
) -> Result<(), Stop> {
    let Some(measured) = &problem.data.value.measured else { return Ok(()) };
    write(study, all, run, || {
        let parts = Parts::of(study, measured, problem)?;
        let posterior = parts.uncompressed_posterior(study, problem);
        let data = &measured.likelihood;
        if !predictions::are_written(&all.calibrated.value, data.count()) {
            return encode(study, all, &posterior, Some(data), None);
        }
        let predictive = Parts::predicting(study, measured, problem)?;
        let predicting = Predicting {
            forward: problem.forward(),
            likelihood: parts.likelihood(),
            law: Law::of(study, measured, problem)?,
            data,
        };
        let predictor = Predictor { densities: predicting, makes: predictive.likelihood() };
        encode(study, all, &posterior, Some(data), Some(&predictor))
    })
}

/// Writes the file of a study whose log density is given.
pub fn of_target(
    study: &Study,
    posterior: &Posterior<'_>,
    all: &Finished<'_>,
    run: &RunDirectory,
) -> Result<(), Stop> {
    write(study, all, run, || encode(study, all, posterior, None, None))
}

fn write(
    study: &Study,
    all: &Finished<'_>,
    run: &RunDirectory,
    make: impl FnOnce() -> Result<File, Stop>,
) -> Result<(), Stop> {
    let mut inputs = json!([
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
    if let (Some(quantities), Some(all)) = (all.quantities, inputs.as_array_mut()) {
        all.push(json!(quantities.hash));
    }
    let path = run.root().join(NAME);
    let marker = run.stage_folder(&Stage::Report.folder()).join(MARKER);
    let inputs = files::hash(inputs.to_string().as_bytes());
    let current = |problem: Marker| {
        problem.inputs == inputs && files::hash_file(&path).is_ok_and(|hash| hash == problem.file)
    };
    // Predictions may take long, and the file may be large: an existing, unchanged file is kept.
    if files::read_json(&marker).is_ok_and(current) {
        return Ok(());
    }
    let made = make()?;
    let hash = files::write_atomic_hashed(&path, |to| made.write(to))?;
    files::write_json(&marker, &Marker { inputs, file: hash })
}

/// The file, with predictions of the data if there is a `predictor`.
fn encode(
    study: &Study,
    all: &Finished<'_>,
    posterior: &Posterior<'_>,
    data: Option<&Observations>,
    predictor: Option<&Predictor<'_>>,
) -> Result<File, Stop> {
    let calibrated = &all.calibrated.value;
    let given = groups::Given {
        study,
        calibrated: &derived::extended(study, calibrated),
        weighed: all.weighed.map(|kept| &kept.value),
        validated: all.validated.map(|kept| &kept.value),
        quantities: all.quantities.map(|kept| &kept.value),
        data,
        from_posterior: match predictor {
            Some(p) => predicted::from_posterior(study, p, calibrated)?,
            None => None,
        },
        from_prior: predicted::from_prior(study, posterior, predictor)?,
    };
    given.file().map_err(|error| Stop::new(format!("cannot write {NAME}: {error}")))
}

/// Suffix that distinguishes the blocks of scenarios in names; empty if there is only one.
fn suffix(block: usize, blocks: usize) -> String {
    if blocks == 1 { String::new() } else { format!("_{}", block + 1) }
}
