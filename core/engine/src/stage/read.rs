//! Stage 3: reading of files.

use std::ops::Range;
use std::path::{Path, PathBuf};

use lacuna::data::{
    Ensemble, FailedRun, Layouts, Measurements, Observations, Replicate, Scenario, Unit,
};
use lacuna::plugin::Reader;
use lacuna::plugin::reader::MeasurementSource;
use lacuna::run::{Observer, Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::arrays::{self, Array};
use lacuna_run::{Artifact, Kept, RunDirectory, Stage};
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::outside::refuse;
use super::simulate::Simulated;
use super::{contents, screen};
use crate::stage::screen::FlaggedCurve;
use crate::study::Study;

mod ensembles;
mod measured;
pub(super) mod outside;

pub use ensembles::{Runs, ensemble, ensemble_of, ensemble_through, ensemble_with_failed};

/// Data that were read.
#[derive(Debug, Clone, PartialEq)]
pub struct Data {
    /// Simulation runs, in a study with a surrogate.
    pub ensemble: Option<Ensemble>,
    /// Measurements, if the study has any.
    pub measured: Option<Measured>,
    /// Cheaper runs, if the study has any; they are kept by a stage of their own.
    pub cheaper: Option<Ensemble>,
}

/// Measurements as the calibration uses them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// All replicates as they were read.
    pub read: Observations,
    /// Replicates without the curves that the screen removed.
    pub used: Observations,
    /// `used` with the curves that the study adds: the data of the likelihood.
    pub likelihood: Observations,
    /// Curves that the screen flagged.
    pub flagged: Vec<FlaggedCurve>,
}

/// Part of an ensemble that is not an array.
#[derive(Serialize, Deserialize)]
struct Labels {
    parameters: Vec<String>,
    units: Vec<Unit>,
    runs: Vec<String>,
    layouts: Layouts,
    valid: Vec<bool>,
    failed: Vec<FailedRun>,
}

impl Artifact for Data {
    fn save(&self, folder: &Path) -> Result<Vec<String>, Stop> {
        let mut names = measured::save(folder, self.measured.as_ref())?;
        let Some(e) = &self.ensemble else { return Ok(names) };
        let arrays = [
            Array::matrix("points", "run", "parameter", &e.points),
            Array::matrix("responses", "run", "output", &e.responses),
        ];
        arrays::write(&folder.join("ensemble.nc"), &[], &arrays)?;
        let labels = Labels {
            parameters: e.parameters.clone(),
            units: e.units.clone(),
            runs: e.runs.clone(),
            layouts: e.layouts.clone(),
            valid: e.valid.clone(),
            failed: e.failed.clone(),
        };
        files::write_json(&folder.join("ensemble.json"), &labels)?;
        names.extend(["ensemble.nc", "ensemble.json"].map(str::to_owned));
        Ok(names)
    }

    fn load(folder: &Path) -> Result<Self, Stop> {
        let measured = measured::load(folder)?;
        let path = folder.join("ensemble.nc");
        if !path.is_file() {
            return Ok(Self { ensemble: None, measured, cheaper: None });
        }
        let labels: Labels = files::read_json(&folder.join("ensemble.json"))?;
        let ensemble = Ensemble {
            parameters: labels.parameters,
            units: labels.units,
            runs: labels.runs,
            points: arrays::read(&path, "points")?.into_matrix(),
            layouts: labels.layouts,
            responses: arrays::read(&path, "responses")?.into_matrix(),
            valid: labels.valid,
            failed: labels.failed,
        };
        Ok(Self { ensemble: Some(ensemble), measured, cheaper: None })
    }
}

impl Data {
    /// Simulation runs of a study with a surrogate.
    pub fn runs(&self) -> Result<&Ensemble, Stop> {
        self.ensemble.as_ref().ok_or_else(|| Stop::new("the study has no simulation runs"))
    }

    /// Hash of all simulation runs, on which a surrogate depends; the measurements are not in it.
    pub fn runs_hash(&self) -> String {
        let hash = |e: &Ensemble| {
            let labels = (&e.parameters, &e.units, &e.runs, &e.layouts, &e.valid, &e.failed);
            let text = json!([labels, e.points.columns()]).to_string();
            files::hash_numbers(&text, &[e.points.as_slice(), e.responses.as_slice()])
        };
        let all: Vec<String> = self.ensemble.iter().chain(&self.cheaper).map(hash).collect();
        files::hash(all.join(" ").as_bytes())
    }
}

/// Reads the simulation runs and the measurements.
pub fn stage(
    study: &Study,
    simulated: Option<&Kept<Simulated>>,
    run: &mut RunDirectory,
    observer: &dyn Observer,
) -> Result<Kept<Data>, Stop> {
    observer.begin(Stage::Read.label(), "file", 0);
    let folder = run.stage_folder(&Stage::Simulate.folder());
    let made = simulated.map(|kept| Runs { folder: &folder, made: &kept.value });
    let inputs = json!([
        simulated.map(|s| &s.hash),
        study.surrogate.is_some(),
        study.simulations.as_ref().map(|s| s.built.identity()),
        study.measurements.as_ref().map(|s| (s.built.identity(), &s.common)),
        source_hash(study)?,
        study.layouts,
        study.parameters.iter().map(|p| (&p.name, &p.unit)).collect::<Vec<_>>(),
    ]);
    let inputs = match &study.hierarchy.trained {
        Some(trained) => json!([inputs, { "trained": trained.study.layouts }]),
        None => inputs,
    };
    let kept = run.keep(&Stage::Read.folder(), &inputs, observer, |_| {
        let trained = study.trained();
        let runs = || ensemble(trained, made);
        let ensemble = study.surrogate.as_ref().map(|_| runs()).transpose()?;
        let measured = measured(study)?;
        Ok(Data { ensemble, measured, cheaper: None })
    })?;
    if let Some(ensemble) = &kept.value.ensemble {
        refuse(study.trained(), ensemble)?;
    }
    let failed: Vec<_> = kept.value.ensemble.iter().flat_map(|e| &e.failed).collect();
    for failed in failed.iter().take(TOLD) {
        observer.warn(&format!("run {} is left out: {}", failed.run, failed.reason));
    }
    if failed.len() > TOLD {
        observer.warn(&format!("{} further runs are left out", failed.len() - TOLD));
    }
    observer.end(Stage::Read.label(), &summary(&kept.value));
    Ok(kept)
}

/// Largest number of omitted runs that are listed individually.
const TOLD: usize = 10;

fn summary(data: &Data) -> String {
    let mut text = match &data.ensemble {
        Some(ensemble) => format!("{} runs, ", ensemble.runs.len()),
        None => String::new(),
    };
    if let Some(measured) = &data.measured {
        text.push_str(&format!("{} data", measured.likelihood.count()));
        let left_out = measured.flagged.iter().filter(|f| f.left_out).count();
        if left_out > 0 {
            text.push_str(&format!(", {left_out} faulty curves left out"));
        }
    }
    text.trim_end_matches(", ").to_owned()
}

/// Hash of the user's own files.
fn source_hash(study: &Study) -> Result<String, Stop> {
    let mut paths = files_of(study, study.simulations.iter().map(|s| &*s.built.plugin));
    if let Some(section) = &study.measurements {
        // Nothing was measured in the others, so that they need no file.
        let measured = study.scenarios.iter().filter(|scenario| !scenario.unmeasured);
        let own =
            |scenario| section.built.plugin.files(&study.directory, Scenario::label(scenario));
        paths.extend(measured.flat_map(own));
    }
    paths.sort();
    paths.dedup();
    files::hash_sources(&paths)
}

/// The user's own files that some readers read, without repetition.
pub fn files_of<'a>(study: &Study, readers: impl Iterator<Item = &'a dyn Reader>) -> Vec<PathBuf> {
    let names: Vec<Option<&str>> = study.scenarios.iter().map(Scenario::label).collect();
    let of = |reader: &dyn Reader| {
        let files = names.iter().flat_map(|name| reader.files(&study.directory, *name));
        files.collect::<Vec<PathBuf>>()
    };
    let mut paths: Vec<PathBuf> = readers.flat_map(of).collect();
    paths.sort();
    paths.dedup();
    paths
}

fn measured(study: &Study) -> Result<Option<Measured>, Stop> {
    measured_or_all(study).map_err(|all| contents::one(&all))
}

/// The measurements, or all errors in their files.
pub(super) fn measured_or_all(study: &Study) -> Result<Option<Measured>, Vec<Stop>> {
    let Some(section) = &study.measurements else { return Ok(None) };
    let read = observations(study, &*section.built.plugin)?;
    if read.count() == 0 {
        return Err(vec![Stop::new("the measurements hold no value")]);
    }
    Ok(Some(screen::screened(&section.common, read)))
}

/// Measurements of all scenarios; a replicate belongs to one scenario and has missing values in the others of its
/// block.
fn observations(study: &Study, reader: &dyn Reader) -> Result<Observations, Vec<Stop>> {
    let mut errors = Vec::new();
    let mut blocks: Vec<Measurements> = study
        .layouts
        .blocks
        .iter()
        .map(|layout| Measurements::new(layout.clone(), Vec::new()))
        .collect();
    let ranges: Vec<Range<usize>> = study.layouts.ranges().collect();
    for scenario in study.scenarios.iter().filter(|scenario| !scenario.unmeasured) {
        let (layout, outputs) = study
            .layouts
            .of_scenario(&scenario.name)
            .ok_or_else(|| vec![Stop::new(format!("no response to `{}`", scenario.name))])?;
        let label = scenario.label();
        let source =
            MeasurementSource { directory: &study.directory, scenario: label, layout: &layout };
        let read = match reader.measurements(&source) {
            Ok(read) => read,
            Err(error) => {
                errors.push(error);
                continue;
            }
        };
        let block = ranges.iter().position(|range| range.contains(&outputs.start)).unwrap_or(0);
        let begin = outputs.start - ranges[block].start;
        let size = ranges[block].len();
        let is_whole = |replicate: &Replicate| replicate.values.len() == size;
        let is_first = label.is_none() && blocks[block].replicates.is_empty();
        if is_first && read.replicates.iter().all(is_whole) {
            blocks[block].replicates = read.replicates;
        } else {
            let replicates = read.replicates.into_iter();
            let padded = replicates.map(|replicate| padded(replicate, label, begin, size));
            blocks[block].replicates.extend(padded);
        }
        if let Some(own) = read.covariance {
            let all = blocks[block].covariance.get_or_insert_with(|| Matrix::zeros(size, size));
            for (i, row) in own.iter_rows().enumerate() {
                all.row_mut(begin + i)[begin..begin + row.len()].copy_from_slice(row);
            }
        }
    }
    if !errors.is_empty() {
        return Err(contents::each(errors));
    }
    blocks.iter().try_for_each(stated_throughout).map_err(|stop| vec![stop])?;
    Ok(Observations { blocks })
}

/// A replicate of a scenario among `size` outputs of its block, of which the scenario has those from `begin` on.
fn padded(replicate: Replicate, label: Option<&str>, begin: usize, size: usize) -> Replicate {
    let mut values = vec![None; size];
    values[begin..begin + replicate.values.len()].copy_from_slice(&replicate.values);
    let name = match label {
        Some(label) => format!("{label} {}", replicate.name),
        None => replicate.name,
    };
    let sd = replicate.sd.map(|own| {
        let mut sd = vec![0.0; size];
        sd[begin..begin + own.len()].copy_from_slice(&own);
        sd
    });
    Replicate { sd, ..Replicate::new(name, values) }
}

/// Requires that noise is stated for all replicates of a block or for none: a likelihood would have to guess the rest.
fn stated_throughout(block: &Measurements) -> Result<(), Stop> {
    if !block.states_noise() {
        return Ok(());
    }
    for replicate in &block.replicates {
        let mut measured = (0..replicate.values.len()).filter(|&i| replicate.values[i].is_some());
        let missing = |i: &usize| !block.stated_variance(replicate, *i).is_some_and(|v| v > 0.0);
        if let Some(i) = measured.find(missing) {
            let (name, place) = (&replicate.name, block.layout.describe(i));
            let text = format!("replicate `{name}` does not state its noise at {place}, others do");
            return Err(Stop::new(text).help("state the noise of all scenarios, or of none"));
        }
    }
    Ok(())
}
