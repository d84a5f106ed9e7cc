//! Import of finished runs made by hand, from a table of the user.

mod table;

use std::fs;
use std::path::{Path, PathBuf};

use lacuna::plugin::Reader;
use lacuna::plugin::model::Response;
use lacuna::run::{Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::{Artifact as _, RunDirectory, write_response};

use super::grow;
use crate::stage::design;
use crate::stage::imports;
use crate::stage::read::{self, Runs};
use crate::stage::simulate::{Made, Roll, RunRecord, Simulated};
use crate::study::Study;
use table::{Row, rows};

/// Result of an import.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Imports {
    /// Folder that contains the imported runs.
    pub folder: PathBuf,
    /// Names of the runs.
    pub runs: Vec<String>,
}

/// Imports finished runs into a run directory: copies their files and records their parameters and hashes.
///
/// The table is CSV with the columns `run` (a name, optional), `file` (relative to the table), `scenario` in a study
/// with scenarios, and one for each parameter, in the study's unit or as `density [g/cm3]`. Files have the format that
/// the study's `[simulations]` reads, or any format that `reader` knows. Runs that the study would refuse when it goes on,
/// by name or parameters, are refused before anything is written.
pub fn import(
    study: &Study,
    run: &RunDirectory,
    table: &Path,
    reader: Option<&dyn Reader>,
) -> Result<Imports, Stop> {
    if study.simulations.as_ref().is_some_and(|s| s.built.plugin.names_files()) {
        return Err(Stop::new("the study takes its runs from files of its own")
            .help("add the runs to the files that `[simulations]` names"));
    }
    let study = study.trained();
    let rows = rows(study, table)?;
    let names: Vec<String> = rows.iter().map(|row| row.run.clone()).collect();
    let wrong =
        |stop: Stop| Stop { message: format!("{}: {}", table.display(), stop.message), ..stop };
    design::accept(study, &names, &points(study, &rows)).map_err(wrong)?;
    let folder = free_folder(run);
    let taken = take(study, &rows, &folder, reader).and_then(|runs| {
        imports::of_folder(study, &folder)?;
        grow::add_import(run, &folder)?;
        Ok(runs)
    });
    match taken {
        Ok(runs) => Ok(Imports { folder, runs }),
        Err(stop) => {
            // An incomplete import is removed.
            fs::remove_dir_all(&folder).map_err(|error| files::cannot_write(&folder, &error))?;
            Err(stop)
        }
    }
}

/// Parameters of the runs.
fn points(study: &Study, rows: &[Row]) -> Matrix {
    Matrix::from_rows(study.parameters.len(), rows.iter().map(|row| row.point.clone()))
}

/// The next unused folder.
fn free_folder(run: &RunDirectory) -> PathBuf {
    let mut number = 1;
    loop {
        let folder = run.root().join(format!("imports/{number}"));
        if !folder.exists() {
            return folder;
        }
        number += 1;
    }
}

/// Copies the files of the runs, writes their table, and reads them as the study will.
fn take(
    study: &Study,
    rows: &[Row],
    folder: &Path,
    reader: Option<&dyn Reader>,
) -> Result<Vec<String>, Stop> {
    let mut scenarios = Vec::new();
    for (i, scenario) in study.scenarios.iter().enumerate() {
        let own =
            scenario.label().map_or_else(PathBuf::new, |_| PathBuf::from((i + 1).to_string()));
        let place = folder.join(&own);
        fs::create_dir_all(&place).map_err(|error| files::cannot_write(&place, &error))?;
        let mut runs = Vec::new();
        for row in rows {
            let from = row.files[i].as_ref().ok_or_else(|| {
                let (run, scenario) = (&row.run, &scenario.name);
                Stop::new(format!("run `{run}` has no file for the scenario `{scenario}`"))
                    .help("a run has one line for each scenario of the study, all with its name and parameters")
            })?;
            let file = match reader {
                Some(reader) => converted(study, &scenario.name, reader, from, &row.run, &place)?,
                None => copied(from, &row.run, &place)?,
            };
            runs.push(RunRecord {
                run: row.run.clone(),
                sha256: Some(files::hash_file(&place.join(&file))?),
                file: Some(file),
                valid: true,
                reason: None,
                seconds: 0.0,
            });
        }
        scenarios.push(Made { folder: own, runs });
    }
    let points = points(study, rows);
    let parameters = study.parameters.iter().map(|p| p.name.clone()).collect();
    let made = Simulated { scenarios, parameters, points };
    made.save(folder)?;
    let names = study.scenarios.iter().map(|scenario| scenario.name.clone());
    let folders = made.scenarios.iter().map(|made| made.folder.clone());
    let runs = rows.iter().map(|row| row.run.clone()).collect();
    Roll { scenarios: names.zip(folders).collect(), runs, executor: None }.write(folder)?;
    read::ensemble_of(study, &study.parameters, Some(Runs { folder, made: &made }))?;
    Ok(rows.iter().map(|row| row.run.clone()).collect())
}

/// Copies a file under the run's name, keeping everything from the first point of its own name on.
fn copied(from: &Path, run: &str, place: &Path) -> Result<String, Stop> {
    let name = from.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let ending = name.split_once('.').map_or(String::new(), |(_, ending)| format!(".{ending}"));
    let file = format!("{run}{ending}");
    files::write_atomic(&place.join(&file), &files::read(from)?)?;
    Ok(file)
}

/// Writes the response that a reader returns in the engine's own format.
fn converted(
    study: &Study,
    scenario: &str,
    reader: &dyn Reader,
    from: &Path,
    run: &str,
    place: &Path,
) -> Result<String, Stop> {
    let (layout, _) = study
        .layouts
        .of_scenario(scenario)
        .ok_or_else(|| Stop::new(format!("no response to `{scenario}`")))?;
    let values = reader.response(from, &layout)?;
    let response = Response { values, valid: true, facts: Vec::new() };
    write_response(place, run, &layout, &response)
}
