//! `csv`: runs and measurements in text tables.

mod ensemble;
mod gathered;
mod inspect;
mod measurements;

use std::path::{Path, PathBuf};

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Ensemble, Layout, Measurements};
use lacuna::plugin::reader::{
    Contents, EnsembleSource, GridSource, Groups, MeasurementSource, ReadError, scenario_path,
};
use lacuna::plugin::{Component, Context, Reader};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cells::LongColumns;
use super::runs;
use super::scenario::Part;
use super::sheet::Sheet;
use super::sierra::heartbeat;
use super::{noise, scenario};
use lacuna::text::values::AllowFailed;

/// Reads comma-separated tables: simulation runs, measurements, and single responses.
///
/// Fields are separated by commas, or by semicolons or tabs if the first line has no comma. The first line names the
/// columns; a name may carry a unit, as in `time [ms]`, and numbers are then converted to the study's unit. Lines
/// that start with `#` are comments.
///
/// **Runs** (section `simulations`): the table `parameters` has the columns `run` and one per parameter. The table
/// `responses` is either long, with the columns `run`, one per axis of the response (`sensor`, `time`) and the
/// response's name; or wide, with one row per run, the column `run` and one column per value, whose heading gives its
/// place (`B 1e-5`). A wide table of a response without axes has one column, named after the response.
///
/// **Measurements** (section `measurements`): one long table `path` with the columns of the axes and the response's
/// name. A column `replicate` names repeated measurements; a table without it is one curve. A blank cell, `NaN`, or
/// an absent row is a missing value, and so is a value with 1 in a column `mask`.
///
/// **Noise** of the measurements, if it is known: a column `sigma` with the standard deviation of each value (in the
/// unit of its heading, else in that of the values), or a file `covariance` for one whole curve. The page of the
/// discrepancy describes how the likelihood uses it.
///
/// **Cut files**: a last line without a line end is refused if its last field is shorter than those above it, as
/// happens when a program is killed while it writes. The field counts as cut if it has fewer decimals, or fewer
/// significant digits, than every other number of a column in which all have equally many, or at least two fewer than
/// nearly all if they vary; if it has a shorter exponent; if it is blank and no other is; or if it is the beginning
/// of a text above it.
///
/// **Scenarios**: in a study with `[[scenario]]` sections the column `scenario` of these tables assigns the rows; or
/// a path contains `{scenario}`, and each scenario has its own file. With `groups` the column of that name assigns the rows
/// of measurements.
///
/// **A single response** of an external simulator: a long table with the axes and the response.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Csv {
    /// Table of measurements, relative to the study file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Table of runs, relative to the study file. Default: the runs that the study simulates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameters: Option<PathBuf>,
    /// Table of the runs' responses, long or wide, relative to the study file. Default: one file per run, named in
    /// the column `file` of the table of runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub responses: Option<PathBuf>,
    /// Covariance of the noise of one curve, relative to the study file, in the squared unit of the response: a
    /// square of numbers, as text without headings or in the variable `covariance` of a netCDF file (`.nc`). Rows and
    /// columns follow the response, its last axis fastest; if the columns of a text have headings as in a wide table,
    /// the rows follow these. It must be symmetric and positive definite.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariance: Option<PathBuf>,
    /// Table of values to be left out, relative to the study file: the columns of the axes and `mask`, which is 1 for
    /// a value that is left out and 0 for one that is used (as in a masked array of `NumPy`), and `replicate` if it
    /// differs between replicates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mask: Option<PathBuf>,
    /// Number of runs without a complete response that may be left out: a fraction if below 1, a count from 1 on.
    /// More of them stop the study.
    pub allow_failed: AllowFailed,
    /// Column of the table of measurements whose values divide the rows into groups, such as `target`, in place of the column
    /// `scenario`. In a study without `[[scenario]]` each value becomes a scenario with this name and the label
    /// `target = NAME`, so that `by = "target"` of a parameter refers to it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub groups: Option<String>,
    /// Columns of a table of measurements to be ignored. Any other column that the reader does not know is an error,
    /// because it may hold a condition.
    pub ignore: Vec<String>,
}

impl Component for Csv {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        for (key, given) in [
            ("covariance", self.covariance.is_some()),
            ("mask", self.mask.is_some()),
            ("groups", self.groups.is_some()),
        ] {
            if given && self.path.is_none() {
                complaints
                    .at(key)
                    .say(format!("`{key}` needs `path`: the measurements that it is about"));
            }
        }
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
            ("covariance", &self.covariance),
            ("mask", &self.mask),
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

    fn allowed_failures(&self, runs: usize) -> Option<usize> {
        Some(self.allow_failed.of(runs))
    }

    fn ensemble(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
        let table = runs::table_path(source, self.parameters.as_deref(), "parameters")?;
        let list = runs::read_runs(&table, source.parameters)?;
        let Some(responses) = &self.responses else {
            return runs::ensemble(source, &table, &list, self.allow_failed, |_, run| {
                let file = run.file.as_ref().ok_or_else(|| {
                    ReadError::new(&table, format!("run `{}` has no file", run.name))
                        .help("name the table of responses with `responses`, or each run's file in a column `file`")
                })?;
                self.response(file, source.layout)
            });
        };
        let (directory, named) = (source.directory, SCENARIO);
        let opened = scenario::sheet(directory, responses, source.scenario, &self.ignore, named)?;
        let path = opened.0.path.clone();
        let values = ensemble::responses(opened, &list, source.layout)?;
        runs::ensemble(source, &table, &list, self.allow_failed, |i, _| {
            let values = values[i].as_ref();
            let values = values.ok_or_else(|| ReadError::new(&path, "has no row for this run"))?;
            complete(&path, source.layout, values)
        })
    }

    fn measurements(&self, source: &MeasurementSource<'_>) -> Result<Measurements, ReadError> {
        let path = self.path.as_ref().ok_or_else(|| {
            ReadError::new(source.directory, "there is no table of measurements")
                .help("name it with `path`")
        })?;
        let part = self.measured(source.directory, path, source.scenario)?;
        let known: Vec<String> = self.ignore.iter().chain(&self.groups).cloned().collect();
        let mut data = measurements::measurements(part, source.layout, &known)?;
        let file = |path: &PathBuf| scenario_path(source.directory, path, source.scenario);
        if let Some(mask) = self.mask.as_ref().map(file) {
            noise::apply_mask(&mask, source.layout, &mut data)?;
        }
        if let Some(path) = self.covariance.as_ref().map(file) {
            if data.states_noise() {
                return Err(ReadError::new(path, "the measurements have a column `sigma` too")
                    .help("the noise is stated once: take out `covariance`, or list `sigma` under `ignore`"));
            }
            data.covariance = Some(noise::covariance(&path, source.layout)?);
        }
        Ok(data)
    }

    fn grid(&self, source: &GridSource<'_>) -> Result<Vec<f64>, ReadError> {
        let path = self.path.as_ref().ok_or_else(|| {
            ReadError::new(source.directory, "there is no table of measurements")
                .help("name it with `path`")
        })?;
        let part = self.measured(source.directory, path, source.scenario)?;
        measurements::grid(part, source.axis, source.unit)
    }

    fn groups(&self, directory: &Path) -> Result<Option<Groups>, ReadError> {
        let (Some(label), Some(path)) = (&self.groups, &self.path) else { return Ok(None) };
        let names = scenario::names(&directory.join(path), label)?;
        Ok(Some(Groups { label: label.clone(), names }))
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
        let own = [&self.path, &self.parameters, &self.responses, &self.covariance, &self.mask];
        let mut files: Vec<PathBuf> = own
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

impl Csv {
    /// The rows of the measurements that belong to a scenario.
    fn measured(
        &self,
        directory: &Path,
        path: &Path,
        scenario: Option<&str>,
    ) -> Result<Part, ReadError> {
        let named = self.groups.as_deref().unwrap_or(SCENARIO);
        Part::open(directory, path, scenario, &self.ignore, named)
    }
}

/// Returns all values of a response; fails if one is missing or not finite.
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

lacuna::register!(Reader, "csv", Csv, aliases: ["tsv", "table"]);

#[cfg(test)]
mod tests;
