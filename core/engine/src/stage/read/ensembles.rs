//! Runs of all scenarios combined into one ensemble.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use lacuna::data::{Ensemble, FailedRun, Parameter};
use lacuna::plugin::Reader;
use lacuna::plugin::reader::EnsembleSource;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::stage::results;
use crate::stage::simulate::{Simulated, inside};
use crate::study::Study;

/// Folder of the runs that the study made, with their records.
#[derive(Clone, Copy)]
pub struct Runs<'a> {
    /// Folder of the stage that made them.
    pub folder: &'a Path,
    /// Records of the runs and their outcomes.
    pub made: &'a Simulated,
}

/// Reads the runs of all scenarios through the study's reader; only runs with a finite response in every scenario are
/// kept.
pub fn ensemble(study: &Study, runs: Option<Runs<'_>>) -> Result<Ensemble, Stop> {
    ensemble_of(study, &study.parameters, runs)
}

/// Reads runs that the study's model made, some of which may have failed, as far as a reader permits. A reader of
/// tables made elsewhere is not used, because it does not know these runs.
pub fn ensemble_with_failed(study: &Study, runs: Runs<'_>) -> Result<Ensemble, Stop> {
    let reader = study.simulations.as_ref().filter(|_| study.design.is_some());
    let reader = reader.map(|section| &*section.built.plugin);
    read_with(study, &study.parameters, Some(runs), |source, _| match reader {
        Some(reader) if reader.names_files() || !results::are_own(source) => {
            Ok(reader.ensemble(source)?)
        }
        _ => results::with_failed(source),
    })
}

/// Reads runs of other parameters.
pub fn ensemble_of(
    study: &Study,
    parameters: &[Parameter],
    runs: Option<Runs<'_>>,
) -> Result<Ensemble, Stop> {
    let reader = study.simulations.as_ref().map(|section| &*section.built.plugin);
    ensemble_through(study, parameters, reader, runs)
}

/// Reads runs through another reader than the study's.
pub fn ensemble_through(
    study: &Study,
    parameters: &[Parameter],
    reader: Option<&dyn Reader>,
    runs: Option<Runs<'_>>,
) -> Result<Ensemble, Stop> {
    read_with(study, parameters, runs, |source, made| match reader {
        Some(reader) if reader.names_files() || !results::are_own(source) => {
            Ok(reader.ensemble(source)?)
        }
        _ => {
            let allowed = match (reader, &study.design) {
                (Some(reader), _) => reader.allowed_failures(made),
                (None, design) => design.as_ref().map(|d| d.common.allow_failed.of(made)),
            };
            results::ensemble(source, allowed.unwrap_or(0))
        }
    })
}

fn read_with(
    study: &Study,
    parameters: &[Parameter],
    runs: Option<Runs<'_>>,
    read: impl Fn(&EnsembleSource<'_>, usize) -> Result<Ensemble, Stop>,
) -> Result<Ensemble, Stop> {
    let mut parts = Vec::new();
    for (i, scenario) in study.scenarios.iter().enumerate() {
        let (layout, outputs) = study
            .layouts
            .of_scenario(&scenario.name)
            .ok_or_else(|| Stop::new(format!("no response to `{}`", scenario.name)))?;
        let simulated = runs.map(|runs| inside(runs.folder, &runs.made.scenarios[i].folder));
        let source = EnsembleSource {
            directory: &study.directory,
            simulated: simulated.as_deref(),
            parameters,
            scenario: scenario.label(),
            layout: &layout,
        };
        let made = runs.map_or(0, |runs| runs.made.scenarios[i].runs.len());
        let ensemble = read(&source, made)?;
        parts.push((ensemble, outputs));
    }
    let joined = joined(study, parts)?;
    if let Some((i, value)) =
        joined.responses.as_slice().iter().enumerate().find(|(_, y)| !y.is_finite())
    {
        let (run, output) = (i / joined.layouts.len(), i % joined.layouts.len());
        return Err(Stop::new(format!(
            "run `{}` has the response {value} at {}",
            joined.runs[run],
            joined.layouts.describe(output)
        )));
    }
    Ok(joined)
}

/// Combines the ensembles of the scenarios.
fn joined(study: &Study, mut parts: Vec<(Ensemble, Range<usize>)>) -> Result<Ensemble, Stop> {
    if parts.len() == 1 {
        return Ok(Ensemble { layouts: study.layouts.clone(), ..parts.remove(0).0 });
    }
    let mut failed: Vec<FailedRun> = Vec::new();
    for ((part, _), scenario) in parts.iter().zip(&study.scenarios) {
        failed.extend(part.failed.iter().map(|f| FailedRun {
            run: f.run.clone(),
            reason: format!("scenario `{}`: {}", scenario.name, f.reason),
        }));
    }
    let first = &parts[0].0;
    let (mut runs, mut valid) = (Vec::new(), Vec::new());
    let mut points = Matrix::zeros(0, first.parameters.len());
    let mut responses = Matrix::zeros(0, study.layouts.len());
    let rows_of: Vec<HashMap<&String, usize>> =
        parts.iter().map(|(part, _)| part.runs.iter().zip(0..).collect()).collect();
    for (i, name) in first.runs.iter().enumerate() {
        let rows: Option<Vec<usize>> = rows_of.iter().map(|rows| rows.get(name).copied()).collect();
        let Some(rows) = rows else { continue };
        let mut response = vec![0.0; study.layouts.len()];
        for ((part, outputs), &row) in parts.iter().zip(&rows) {
            if part.points.row(row) != first.points.row(i) {
                return Err(Stop::new(format!(
                    "run `{name}` has other parameters in another scenario"
                )));
            }
            response[outputs.clone()].copy_from_slice(part.responses.row(row));
        }
        valid.push(parts.iter().zip(&rows).all(|((part, _), &row)| part.valid[row]));
        points.push_row(first.points.row(i));
        responses.push_row(&response);
        runs.push(name.clone());
    }
    if runs.is_empty() {
        return Err(Stop::new("no run has a response in every scenario"));
    }
    Ok(Ensemble {
        parameters: first.parameters.clone(),
        units: first.units.clone(),
        runs,
        points,
        layouts: study.layouts.clone(),
        responses,
        valid,
        failed,
    })
}
