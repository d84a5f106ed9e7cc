//! Finished runs made by hand, from a table of the user's.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::grow;
use crate::data::Unit;
use crate::linalg::Matrix;
use crate::plugin::Reader;
use crate::plugin::model::Response;
use crate::run::{Artifact as _, RunDirectory, Stop, files, write_response};
use crate::stage::imports;
use crate::stage::read::{self, Runs};
use crate::stage::simulate::{Made, RunRecord, Simulated};
use crate::study::Study;

/// What was imported.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Imports {
    /// The folder that holds it.
    pub folder: PathBuf,
    /// The names of the runs.
    pub runs: Vec<String>,
}

/// Takes finished runs into a run directory: copies their files and notes their parameters and hashes.
///
/// The table is CSV with the columns `run` (a name, may be left out), `file` (relative to the table), `scenario` in a study
/// with scenarios, and one for each parameter, in the study's unit or as `density [g/cm3]`. Files are as the study's
/// `[simulations]` reads them, or of any format that `reader` knows.
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
    let rows = rows(study, table)?;
    let folder = free_folder(run);
    let taken = take(study, &rows, &folder, reader).and_then(|runs| {
        imports::of_folder(study, &folder)?;
        grow::add_import(run, &folder)?;
        Ok(runs)
    });
    match taken {
        Ok(runs) => Ok(Imports { folder, runs }),
        Err(stop) => {
            // Half an import is none.
            fs::remove_dir_all(&folder).map_err(|error| files::cannot_write(&folder, &error))?;
            Err(stop)
        }
    }
}

/// The next folder that nobody uses.
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

/// A run of the table.
struct Row {
    run: String,
    point: Vec<f64>,
    /// The file of each scenario.
    files: Vec<Option<PathBuf>>,
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
                Stop::new(format!(
                    "run `{}` has no file for the scenario `{}`",
                    row.run, scenario.name
                ))
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
    let points = Matrix::from_rows(study.parameters.len(), rows.iter().map(|r| r.point.clone()));
    let parameters = study.parameters.iter().map(|p| p.name.clone()).collect();
    let made = Simulated { scenarios, parameters, points };
    made.save(folder)?;
    read::ensemble_of(study, &study.parameters, Some(Runs { folder, made: &made }))?;
    Ok(rows.iter().map(|row| row.run.clone()).collect())
}

/// The file under the run's name, with all that follows the first point of its own.
fn copied(from: &Path, run: &str, place: &Path) -> Result<String, Stop> {
    let name = from.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let ending = name.split_once('.').map_or(String::new(), |(_, ending)| format!(".{ending}"));
    let file = format!("{run}{ending}");
    files::write_atomic(&place.join(&file), &files::read(from)?)?;
    Ok(file)
}

/// The response that a reader finds, in the engine's own format.
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

/// The runs of the table, each with all its scenarios.
fn rows(study: &Study, table: &Path) -> Result<Vec<Row>, Stop> {
    let bytes = files::read(table)?;
    let wrong = |place: &str, what: String| {
        Stop::new(format!("{}{place}: {what}", table.display()))
            .help("the columns are `run`, `file`, `scenario` in a study with scenarios, and one for each parameter, such as `density [kg/m3]`")
    };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(&bytes[..]);
    let header = reader.headers().map_err(|e| wrong("", e.to_string()))?.clone();
    let column = |name: &str| header.iter().position(|h| h == name);
    let file = column("file").ok_or_else(|| wrong("", "there is no column `file`".to_owned()))?;
    let mut parameters = Vec::new();
    for parameter in &study.parameters {
        let found = header.iter().enumerate().find_map(|(i, heading)| {
            let (name, unit) = heading.split_once('[').unwrap_or((heading, ""));
            (name.trim() == parameter.name).then(|| (i, unit.trim_end_matches(']').trim()))
        });
        let (i, unit) = found.ok_or_else(|| {
            wrong("", format!("there is no column for the parameter `{}`", parameter.name))
        })?;
        let unit = if unit.is_empty() {
            parameter.unit.clone()
        } else {
            Unit::parse(unit).map_err(|error| wrong(", line 1", error.to_string()))?
        };
        let factor = unit.factor_to(&parameter.unit).ok_or_else(|| {
            wrong(
                ", line 1",
                format!(
                    "`{unit}` does not convert to `{}`, the unit of `{}`",
                    parameter.unit, parameter.name
                ),
            )
        })?;
        parameters.push((i, factor, &parameter.name));
    }
    let (named, of_scenario) = (column("run"), column("scenario"));
    let folder = table.parent().unwrap_or(Path::new(""));
    let mut found: BTreeMap<usize, Row> = BTreeMap::new();
    let mut order: BTreeMap<String, usize> = BTreeMap::new();
    for (number, record) in reader.records().enumerate() {
        let line = format!(", line {}", number + 2);
        let record = record.map_err(|e| wrong(&line, e.to_string()))?;
        let run = named.map_or_else(|| format!("hand{:03}", number + 1), |i| record[i].to_owned());
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        if run.is_empty() || !run.chars().all(is_plain) {
            return Err(wrong(
                &line,
                format!("`{run}` is no name of a run: expected letters, digits, `-` and `_`"),
            ));
        }
        let number_in = |&(i, factor, name): &(usize, f64, &String)| {
            let value = record[i].parse::<f64>().ok().filter(|x| x.is_finite());
            value.map(|x| x * factor).ok_or_else(|| {
                wrong(&line, format!("expected a number for `{name}`, found `{}`", &record[i]))
            })
        };
        let point = parameters.iter().map(number_in).collect::<Result<Vec<f64>, Stop>>()?;
        let scenario = of_scenario.map_or("", |i| &record[i]);
        let place = study
            .scenarios
            .iter()
            .position(|s| s.name == scenario)
            .ok_or_else(|| wrong(&line, format!("the study has no scenario `{scenario}`")))?;
        let next = order.len();
        let key = *order.entry(run.clone()).or_insert(next);
        let row = found.entry(key).or_insert_with(|| Row {
            run: run.clone(),
            point: point.clone(),
            files: vec![None; study.scenarios.len()],
        });
        if row.point != point {
            return Err(wrong(&line, format!("run `{run}` has other parameters in another line")));
        }
        if row.files[place].is_some() {
            return Err(wrong(&line, format!("there are two files for run `{run}`")));
        }
        row.files[place] = Some(folder.join(&record[file]));
    }
    if found.is_empty() {
        return Err(wrong("", "there is no run in it".to_owned()));
    }
    Ok(found.into_values().collect())
}
