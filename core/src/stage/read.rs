//! Stage 3: files become data.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::data::{Ensemble, FailedRun, Layout, Measurements, Unit};
use crate::plugin::reader::{EnsembleSource, MeasurementSource};
use crate::report::findings::FlaggedCurve;
use crate::run::arrays::{self, Array};
use crate::run::{Artifact, Kept, Observer, RunDirectory, Stop, files};
use crate::study::Study;

use super::screen;
use super::simulate::Simulated;

/// What was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Data {
    /// The simulation runs.
    pub ensemble: Ensemble,
    /// The measurements, if the study has any.
    pub measured: Option<Measured>,
}

/// The measurements as the calibration uses them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// All replicates as they were read.
    pub read: Measurements,
    /// The replicates without the curves that the screen left out.
    pub used: Measurements,
    /// `used` with the curves that the study adds: the data of the likelihood.
    pub likelihood: Measurements,
    /// The curves that the screen flagged.
    pub flagged: Vec<FlaggedCurve>,
}

/// The part of an ensemble that is not an array.
#[derive(Serialize, Deserialize)]
struct Labels {
    parameters: Vec<String>,
    units: Vec<Unit>,
    runs: Vec<String>,
    layout: Layout,
    valid: Vec<bool>,
    failed: Vec<FailedRun>,
}

impl Artifact for Data {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let e = &self.ensemble;
        let arrays = [
            Array::matrix("points", "run", "parameter", &e.points),
            Array::matrix("responses", "run", "output", &e.responses),
        ];
        arrays::write(&folder.join("ensemble.nc"), &[], &arrays)?;
        let labels = Labels {
            parameters: e.parameters.clone(),
            units: e.units.clone(),
            runs: e.runs.clone(),
            layout: e.layout.clone(),
            valid: e.valid.clone(),
            failed: e.failed.clone(),
        };
        files::write_json(&folder.join("ensemble.json"), &labels)?;
        files::write_json(&folder.join("measurements.json"), &self.measured)?;
        Ok(["ensemble.nc", "ensemble.json", "measurements.json"].map(str::to_owned).to_vec())
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let path = folder.join("ensemble.nc");
        let labels: Labels = files::read_json(&folder.join("ensemble.json"))?;
        let ensemble = Ensemble {
            parameters: labels.parameters,
            units: labels.units,
            runs: labels.runs,
            points: arrays::read(&path, "points")?.into_matrix(),
            layout: labels.layout,
            responses: arrays::read(&path, "responses")?.into_matrix(),
            valid: labels.valid,
            failed: labels.failed,
        };
        Ok(Self { ensemble, measured: files::read_json(&folder.join("measurements.json"))? })
    }
}

/// Reads the simulation runs and the measurements.
pub fn stage(
    study: &Study,
    simulated: Option<&Kept<Simulated>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Data>, Stop> {
    observer.begin("read", "file", 0);
    let folder = run.stage_folder("2-simulate");
    let made = simulated.map(|_| folder.as_path());
    let inputs = json!([
        simulated.map(|s| &s.hash),
        study.simulations.as_ref().map(|s| (s.built.name, &s.built.options)),
        study.measurements.as_ref().map(|s| (s.built.name, &s.built.options, &s.common)),
        source_hash(study)?,
        study.layout,
        study.parameters.iter().map(|p| (&p.name, &p.unit)).collect::<Vec<_>>(),
    ]);
    let kept = run.keep("3-read", &inputs, observer, |_| {
        let ensemble = ensemble(study, made)?;
        let measured = measured(study)?;
        Ok(Data { ensemble, measured })
    })?;
    for failed in &kept.value.ensemble.failed {
        observer.warn(&format!("run {} is left out: {}", failed.run, failed.reason));
    }
    observer.end("read", &summary(&kept.value));
    Ok(kept)
}

fn summary(data: &Data) -> String {
    let mut text = format!("{} runs", data.ensemble.runs.len());
    if let Some(measured) = &data.measured {
        text.push_str(&format!(", {} data", measured.likelihood.count()));
        let left_out = measured.flagged.iter().filter(|f| f.left_out).count();
        if left_out > 0 {
            text.push_str(&format!(", {left_out} faulty curves left out"));
        }
    }
    text
}

/// The hash of the user's own files.
fn source_hash(study: &Study) -> Result<String, Stop> {
    let runs = study.simulations.iter().map(|s| &s.built.plugin);
    let data = study.measurements.iter().map(|s| &s.built.plugin);
    let paths: Vec<_> =
        runs.chain(data).flat_map(|reader| reader.files(&study.directory)).collect();
    files::hash_sources(&paths)
}

fn ensemble(study: &Study, simulated: Option<&Path>) -> Result<Ensemble, Stop> {
    let source = EnsembleSource {
        directory: &study.directory,
        simulated,
        parameters: &study.parameters,
        layout: &study.layout,
    };
    from_files(study, &source)
}

/// The runs of a source through the study's reader, every response finite.
pub fn from_files(study: &Study, source: &EnsembleSource<'_>) -> Result<Ensemble, Stop> {
    let ensemble = match &study.simulations {
        Some(section) => section.built.plugin.ensemble(source)?,
        None => super::results::ensemble(source)?,
    };
    if let Some((i, value)) =
        ensemble.responses.as_slice().iter().enumerate().find(|(_, y)| !y.is_finite())
    {
        let (run, output) = (i / ensemble.layout.len(), i % ensemble.layout.len());
        return Err(Stop::new(format!(
            "run `{}` has the response {value} at {}",
            ensemble.runs[run],
            ensemble.layout.describe(output)
        )));
    }
    Ok(ensemble)
}

fn measured(study: &Study) -> Result<Option<Measured>, Stop> {
    let Some(section) = &study.measurements else { return Ok(None) };
    let source = MeasurementSource { directory: &study.directory, layout: &study.layout };
    let read = section.built.plugin.measurements(&source)?;
    if read.count() == 0 {
        return Err(Stop::new("the measurements hold no value"));
    }
    let flagged = match &section.common.screen {
        Some(options) => screen::flag(&read, options.threshold.get(), options.leave_out),
        None => Vec::new(),
    };
    let used = screen::without(&read, &flagged);
    let likelihood = screen::with_added_curves(&used, &section.common.added_curves);
    Ok(Some(Measured { read, used, likelihood, flagged }))
}
