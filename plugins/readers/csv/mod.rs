//! `csv`: runs and measurements in text tables.

mod ensemble;
mod inspect;
mod measurements;

use std::path::{Path, PathBuf};

use lacuna::data::{Ensemble, Layout, Measurements};
use lacuna::plugin::reader::{
    Contents, EnsembleSource, GridSource, MeasurementSource, ReadError, scenario_path,
};
use lacuna::plugin::{Component, Context, Reader};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cells::LongColumns;
use super::runs::{self, AllowFailed};
use super::scenario;
use super::sheet::Sheet;
use super::sierra::heartbeat;

/// Reads comma-separated tables: simulation runs, measurements, and single responses.
///
/// Fields are separated by commas, or by semicolons or tabs if the first line has no comma. The
/// first line names the columns; a name may carry a unit, as in `time [ms]`, and numbers are then
/// converted to the study's unit. Lines that start with `#` are comments.
///
/// **Runs** (section `simulations`): the table `parameters` has the columns `run` and one a
/// parameter; the table `responses` is long, with the columns `run`, one an axis of the response
/// (`sensor`, `time`) and the response's name, or wide: one row a run, the column `run` and one a
/// value, headed by its place (`B 1e-5`). A wide table of a response without axes has one column,
/// named after the response.
///
/// **Measurements** (section `measurements`): one long table `path` with the columns `replicate`,
/// the axes and the response's name. A blank cell, `NaN`, or a row that is not there is a missing
/// value.
///
/// **Scenarios**: in a study with `[[scenario]]` sections the column `scenario` of these tables says to which a row
/// belongs; or a path holds `{scenario}`, and each scenario has a file of its own.
///
/// **A single response** of an external simulator: a long table with the axes and the response.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Csv {
    /// Table of measurements, relative to the study file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Table of runs, relative to the study file. Left out, the runs are those that the study
    /// simulates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameters: Option<PathBuf>,
    /// Table of the runs' responses, long or wide, relative to the study file. Left out, each run
    /// has a file of its own, named in the column `file` of the table of runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub responses: Option<PathBuf>,
    /// How many runs without a complete response may be left out: below 1 a fraction, from 1 on a
    /// count.
    pub allow_failed: AllowFailed,
    /// Columns of a table of measurements that mean nothing to the study. Any other column that
    /// the reader does not know is an error.
    pub ignore: Vec<String>,
}

impl Component for Csv {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if self.responses.is_some() && self.parameters.is_none() {
            complaints
                .at("responses")
                .say("`responses` needs `parameters`: the table of the runs they belong to");
        }
    }

    fn environment(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let paths = [
            ("path", &self.path),
            ("parameters", &self.parameters),
            ("responses", &self.responses),
        ];
        let paths = paths.map(|(key, path)| (key, path.as_deref()));
        scenario::check_files(paths, context, complaints);
    }
}

impl Reader for Csv {
    fn recognises(&self, path: &Path, head: &[u8]) -> bool {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let table = ["csv", "tsv", "txt"].iter().any(|e| extension.eq_ignore_ascii_case(e));
        table && !head.contains(&0) && !heartbeat::recognised(head)
    }

    fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
        Ok(inspect::contents(&Sheet::read(path)?))
    }

    fn names_files(&self) -> bool {
        self.path.is_some() || self.parameters.is_some()
    }

    fn ensemble(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
        let table = runs::table_path(source, self.parameters.as_deref(), "parameters")?;
        let list = runs::read_runs(&table, source.parameters)?;
        let Some(responses) = &self.responses else {
            return runs::ensemble(source, &table, &list, self.allow_failed, |run| {
                let file = run.file.as_ref().ok_or_else(|| {
                    ReadError::new(&table, format!("run `{}` has no file", run.name))
                        .help("name the table of responses with `responses`, or each run's file in a column `file`")
                })?;
                self.response(file, source.layout)
            });
        };
        let sheet = scenario::sheet(source.directory, responses, source.scenario, &self.ignore)?;
        let values = ensemble::responses(&sheet, &list, source.layout)?;
        runs::ensemble(source, &table, &list, self.allow_failed, |run| {
            let values = list.iter().position(|r| r.name == run.name).map(|i| &values[i]);
            complete(&sheet.path, source.layout, values.map_or(&[][..], Vec::as_slice))
        })
    }

    fn measurements(&self, source: &MeasurementSource<'_>) -> Result<Measurements, ReadError> {
        let path = self.path.as_ref().ok_or_else(|| {
            ReadError::new(source.directory, "there is no table of measurements")
                .help("name it with `path`")
        })?;
        let sheet = scenario::sheet(source.directory, path, source.scenario, &self.ignore)?;
        measurements::measurements(&sheet, source.layout, &self.ignore)
    }

    fn grid(&self, source: &GridSource<'_>) -> Result<Vec<f64>, ReadError> {
        let path = self.path.as_ref().ok_or_else(|| {
            ReadError::new(source.directory, "there is no table of measurements")
                .help("name it with `path`")
        })?;
        let sheet = scenario::sheet(source.directory, path, source.scenario, &self.ignore)?;
        measurements::grid(&sheet, source.axis, source.unit)
    }

    fn response(&self, path: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
        let sheet = Sheet::read(path)?;
        let columns = LongColumns::find(&sheet, layout)?;
        let mut values = vec![None; layout.len()];
        let mut seen = vec![false; layout.len()];
        for record in &sheet.records {
            let place = columns.place(&sheet, record)?;
            if std::mem::replace(&mut seen[place], true) {
                let text = format!("a second value for {}", layout.describe(place));
                return Err(sheet.complain(record, columns.value, text));
            }
            values[place] = columns.number(&sheet, record)?;
        }
        complete(path, layout, &values)
    }

    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
        let mut files: Vec<PathBuf> = [&self.path, &self.parameters, &self.responses]
            .into_iter()
            .flatten()
            .map(|path| scenario_path(directory, path, scenario))
            .collect();
        if let (Some(table), None) = (&self.parameters, &self.responses) {
            files.extend(runs::named_files(&scenario_path(directory, table, scenario)));
        }
        files
    }
}

/// All values of a response, or which one is missing or not finite.
fn complete(path: &Path, layout: &Layout, values: &[Option<f64>]) -> Result<Vec<f64>, ReadError> {
    let missing = values.iter().filter(|y| y.is_none()).count();
    let first = values.iter().position(Option::is_none);
    if values.len() != layout.len() || first.is_some() {
        let place = first.map_or(String::new(), |i| format!(", first at {}", layout.describe(i)));
        let text = format!("{missing} of {} values are missing{place}", layout.len());
        return Err(ReadError::new(path, text));
    }
    let values: Vec<f64> = values.iter().flatten().copied().collect();
    runs::finite(path, layout, &values)?;
    Ok(values)
}

lacuna::register!(Reader, "csv", Csv);

#[cfg(test)]
mod tests;
