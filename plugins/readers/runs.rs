//! Simulation runs: the table of their parameters, and the ensemble built from them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use lacuna::data::{Ensemble, FailedRun, Parameter};
use lacuna::plugin::reader::{EnsembleSource, ReadError, scenario_path};
use lacuna::text::values::AllowFailed;
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use super::sheet::{Conversion, Record, Sheet};

/// Name of the table of runs that the simulate stage writes.
const SIMULATED: &str = "runs.csv";
/// Maximum number of failed runs named in an error.
const NAMED: usize = 10;

/// Row of the table that describes one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Name of the run.
    pub name: String,
    /// Result file, if the table names one.
    pub file: Option<PathBuf>,
    /// Reason for the failure, if the table states one.
    pub failure: Option<String>,
    /// True if the run stayed inside the model's range of validity.
    pub valid: bool,
    /// Parameters, in the order and the units of the study.
    pub point: Vec<f64>,
}

/// Returns the path of the table that a reader's options name, or else of the one that the simulate stage wrote;
/// fails if there is neither.
pub fn table_path(
    source: &EnsembleSource<'_>,
    named: Option<&Path>,
    key: &str,
) -> Result<PathBuf, ReadError> {
    match (named, source.simulated) {
        (Some(path), _) => Ok(scenario_path(source.directory, path, source.scenario)),
        (None, Some(folder)) => Ok(folder.join(SIMULATED)),
        (None, None) => Err(ReadError::new(source.directory, "there are no simulation runs")
            .help(format!("name a table of runs with `{key}`, or let the study simulate"))),
    }
}

/// Reads a table with the columns `run` and one per parameter, and optionally `file`, `status`, `valid` and `reason`.
/// Relative paths start at the table's folder.
pub fn read_runs(path: &Path, parameters: &[Parameter]) -> Result<Vec<Run>, ReadError> {
    let (sheet, mut faults) = Sheet::open(path)?;
    let run = faults.take(sheet.heading_line, sheet.column("run"));
    let columns: Vec<_> = parameters
        .iter()
        .filter_map(|p| faults.take(sheet.heading_line, parameter_column(&sheet, p)))
        .collect();
    let Some(run) = run.filter(|_| columns.len() == parameters.len()) else {
        return faults.or(Vec::new());
    };
    let mut names = BTreeSet::new();
    let mut runs = Vec::with_capacity(sheet.records.len());
    for record in &sheet.records {
        let name = record.cells[run].to_owned();
        if name.is_empty() || !names.insert(name.clone()) {
            let text = if name.is_empty() {
                "has no name".into()
            } else {
                format!("`{name}` appears twice")
            };
            faults.note(record.line, sheet.complain(record, run, format!("a run {text}")));
        }
        let one = |(column, conversion): &(usize, Conversion)| {
            number(&sheet, record, *column, conversion)
        };
        let point: Vec<f64> =
            columns.iter().filter_map(|column| faults.take(record.line, one(column))).collect();
        let file = cell(&sheet, record, "file").filter(|text| !text.is_empty());
        let failure = faults.take(record.line, failure(&sheet, record)).flatten();
        let valid = faults.take(record.line, word(&sheet, record, "valid", ["true", "false"]));
        runs.push(Run {
            name,
            file: file.map(|file| path.with_file_name(file)),
            failure,
            valid: valid.unwrap_or_default(),
            point,
        });
    }
    if runs.is_empty() && faults.is_empty() {
        return Err(ReadError::new(path, "has no runs"));
    }
    faults.or(runs)
}

fn parameter_column(sheet: &Sheet, p: &Parameter) -> Result<(usize, Conversion), ReadError> {
    let column = sheet.column(&p.name)?;
    // `height[A]` is the parameter of scenario `A`, not a parameter in amperes.
    let of_scenario = p.name.ends_with(']') && sheet.headings[column].text == p.name;
    let conversion =
        if of_scenario { Conversion::none(&p.unit) } else { sheet.conversion(column, &p.unit)? };
    Ok((column, conversion))
}

fn number(
    sheet: &Sheet,
    record: &Record,
    column: usize,
    conversion: &Conversion,
) -> Result<f64, ReadError> {
    let x = sheet.number(record, column)?.and_then(|x| conversion.apply(x));
    x.filter(|x| x.is_finite()).ok_or_else(|| {
        let text = format!("expected a finite number, found `{}`", &record.cells[column]);
        sheet.complain(record, column, text)
    })
}

fn cell<'a>(sheet: &Sheet, record: &'a Record, name: &str) -> Option<&'a str> {
    sheet.find(name).map(|column| &record.cells[column])
}

/// Returns true if a cell holds the first of two words; also if the column or the word is missing.
fn word(sheet: &Sheet, record: &Record, name: &str, words: [&str; 2]) -> Result<bool, ReadError> {
    let Some(column) = sheet.find(name) else { return Ok(true) };
    let found = &record.cells[column];
    if found.is_empty() || found.eq_ignore_ascii_case(words[0]) {
        Ok(true)
    } else if found.eq_ignore_ascii_case(words[1]) {
        Ok(false)
    } else {
        let text = format!("expected `{}` or `{}`, found `{found}`", words[0], words[1]);
        Err(sheet.complain(record, column, text))
    }
}

fn failure(sheet: &Sheet, record: &Record) -> Result<Option<String>, ReadError> {
    if word(sheet, record, "status", ["done", "failed"])? {
        return Ok(None);
    }
    let reason = cell(sheet, record, "reason").unwrap_or_default();
    Ok(Some(if reason.is_empty() { "failed".to_owned() } else { reason.to_owned() }))
}

/// Assembles the responses of the runs; `response` gets the index of a run and the run. Runs that the table marks as failed,
/// and runs whose response cannot be read, are listed and left out; fails if there are more than allowed.
pub fn ensemble(
    source: &EnsembleSource<'_>,
    table: &Path,
    runs: &[Run],
    allow_failed: AllowFailed,
    response: impl Fn(usize, &Run) -> Result<Vec<f64>, ReadError> + Sync,
) -> Result<Ensemble, ReadError> {
    let outcomes: Vec<Result<Vec<f64>, String>> = runs
        .par_iter()
        .enumerate()
        .map(|(i, run)| match &run.failure {
            Some(reason) => Err(reason.clone()),
            None => response(i, run).map_err(|error| error.to_string()),
        })
        .collect();
    let mut failed = Vec::new();
    let mut kept: Vec<(&Run, Vec<f64>)> = Vec::new();
    for (run, outcome) in runs.iter().zip(outcomes) {
        match outcome {
            Ok(values) => kept.push((run, values)),
            Err(reason) => failed.push(FailedRun { run: run.name.clone(), reason }),
        }
    }
    let allowed = allow_failed.of(runs.len());
    if failed.len() > allowed || kept.is_empty() {
        return Err(too_many(table, &failed, runs.len(), allowed));
    }
    Ok(Ensemble {
        parameters: source.parameters.iter().map(|p| p.name.clone()).collect(),
        units: source.parameters.iter().map(|p| p.unit.clone()).collect(),
        runs: kept.iter().map(|(run, _)| run.name.clone()).collect(),
        points: Matrix::from_rows(source.parameters.len(), kept.iter().map(|(run, _)| &run.point)),
        layouts: source.layout.clone().into(),
        responses: Matrix::from_rows(source.layout.len(), kept.iter().map(|(_, values)| values)),
        valid: kept.iter().map(|(run, _)| run.valid).collect(),
        failed,
    })
}

fn too_many(table: &Path, failed: &[FailedRun], runs: usize, allowed: usize) -> ReadError {
    let count = failed.len();
    let named: String =
        failed.iter().take(NAMED).map(|f| format!("\n  `{}`: {}", f.run, f.reason)).collect();
    let more = count.saturating_sub(NAMED);
    let rest = if more > 0 { format!("\n  and {more} more") } else { String::new() };
    let text = format!(
        "{count} of {runs} runs cannot be used, and {allowed} may be left out:{named}{rest}"
    );
    ReadError::new(table, text)
        .help("`allow_failed` says how many runs may be left out, as a count or a fraction")
}

/// Fails at the first value of a response that is not finite.
pub fn finite(path: &Path, source: &lacuna::data::Layout, values: &[f64]) -> Result<(), ReadError> {
    match values.iter().position(|y| !y.is_finite()) {
        None => Ok(()),
        Some(i) => {
            let text = format!("the response is {} at {}", values[i], source.describe(i));
            Err(ReadError::new(path, text))
        }
    }
}

/// Returns the result files that a table names; none if the table cannot be read.
pub fn named_files(table: &Path) -> Vec<PathBuf> {
    let runs = read_runs(table, &[]).unwrap_or_default();
    runs.into_iter().filter_map(|run| run.file).collect()
}
