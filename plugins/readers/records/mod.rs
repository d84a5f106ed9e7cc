//! Measured records in files of named arrays: the options and the reading that `hdf5`, `matlab` and `tdms` share.

mod check;
mod cut;
pub mod filter;
pub mod place;
mod read;
pub mod store;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lacuna::data::{Ensemble, Layout, Measurements, Unit};
use lacuna::plugin::reader::{
    EnsembleSource, GridSource, MeasurementSource, ReadError, scenario_path,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::place::{Resample, Trigger};
use self::read::Reading;
use self::store::{REPLICATE, Store, by_number, captured};
use super::runs;
use super::{listed, scenario};
use lacuna::text::values::AllowFailed;

/// Name by which `axes` calls the dimension of the replicates.
const REPLICATES: &str = "replicate";

/// Implements a reader that is a newtype of [`Records`], from the functions that open and recognise its files, and whether
/// the files may state the times of samples.
macro_rules! reads_records {
    ($reader:ty, $open:path, $recognises:path, $states_times:literal) => {
        impl lacuna::plugin::Component for $reader {
            fn check(
                &self,
                context: &lacuna::plugin::Context<'_>,
                complaints: &mut lacuna::text::problem::Complaints<'_>,
            ) {
                self.0.check($states_times, context, complaints);
            }

            fn environment(
                &self,
                context: &lacuna::plugin::Context<'_>,
                complaints: &mut lacuna::text::problem::Complaints<'_>,
            ) {
                self.0.check_files(context, complaints);
            }
        }

        impl Reader for $reader {
            fn recognises(&self, path: &Path, head: &[u8]) -> bool {
                $recognises(path, head)
            }

            fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
                Ok(store::contents(&*$open(path)?))
            }

            fn names_files(&self) -> bool {
                self.0.path.is_some() || self.0.runs.is_some()
            }

            fn allowed_failures(&self, runs: usize) -> Option<usize> {
                Some(self.0.allow_failed.of(runs))
            }

            fn ensemble(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
                self.0.ensemble($open, source)
            }

            fn measurements(
                &self,
                source: &MeasurementSource<'_>,
            ) -> Result<Measurements, ReadError> {
                self.0.measurements($open, source)
            }

            fn grid(&self, source: &GridSource<'_>) -> Result<Vec<f64>, ReadError> {
                self.0.grid($open, source)
            }

            fn response(&self, path: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
                self.0.response($open, path, layout)
            }

            fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
                self.0.files(directory, scenario)
            }
        }
    };
}
pub(crate) use reads_records;

/// Opens a file of a format.
pub type Open = fn(&Path) -> Result<Box<dyn Store>, ReadError>;

/// Options of a reader of records.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(inline)]
pub struct Records {
    /// File of measurements, relative to the study file. With `{replicate}` in its name each replicate is a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Table of runs (CSV), relative to the study file: the columns `run`, `file` and one per parameter. Default: the
    /// runs that the study simulates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs: Option<PathBuf>,
    /// Dataset of the values. The name of a label axis in braces is replaced by the label, as in `strain_{sensor}`;
    /// `{replicate}` stands for the name of a replicate, and every name with which there is such a dataset is one.
    /// Default: the name of the response.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dataset: Option<String>,
    /// Meaning of the dimensions of a dataset: `replicate`, and the axes of the response that `dataset` does not name.
    /// Default: these axes in the order of the response, after `replicate` if there is one dimension more. Dimensions of
    /// length one may be left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<Vec<String>>,
    /// Labels along a dimension, in the order of the file. Labels that the response does not have are ignored.
    /// Default: the labels of the response.
    pub labels: BTreeMap<String, Vec<String>>,
    /// Dataset of the numbers of the response's numeric axis, such as times; placeholders as in `dataset`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Time of the first sample, in `time_unit`, for records at a constant rate. Default: 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first: Option<f64>,
    /// Interval between samples, in `time_unit`, in place of `time`. Default: that of a TDMS file (`wf_increment`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<f64>,
    /// Unit of the values, in place of that of the file: the attribute `units` or `unit` of a dataset in HDF5, the property
    /// `unit_string` of a channel in TDMS. Default: the unit of the response.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Unit of the times, in place of that of the file. Default: the unit of the response's axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_unit: Option<Unit>,
    /// How samples come to the times of the response.
    pub resample: Resample,
    /// Aligns each record by a crossing of a channel. It needs `resample`, because a crossing lies between two samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trigger: Option<Trigger>,
    /// Number of runs without a complete response that may be left out: a fraction if below 1, a count from 1 on.
    /// More of them stop the study.
    pub allow_failed: AllowFailed,
}

impl Records {
    /// Reads simulation runs, one file each.
    pub fn ensemble(&self, open: Open, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
        let table = runs::table_path(source, self.runs.as_deref(), "runs")?;
        let list = runs::read_runs(&table, source.parameters)?;
        runs::ensemble(source, &table, &list, self.allow_failed, |_, run| {
            let file = run.file.as_ref().ok_or_else(|| {
                ReadError::new(&table, format!("run `{}` has no file", run.name))
                    .help("name it in a column `file`")
            })?;
            self.response(open, file, source.layout)
        })
    }

    /// Reads the one record of a file; fails if a value is missing.
    pub fn response(
        &self,
        open: Open,
        path: &Path,
        layout: &Layout,
    ) -> Result<Vec<f64>, ReadError> {
        let store = open(path)?;
        let read = Reading::new(self, &*store, layout)?.replicates()?;
        let [one] = &read.replicates[..] else {
            let text = format!("expected one record, found {} replicates", read.replicates.len());
            return Err(ReadError::new(path, text));
        };
        if let Some(i) = one.values.iter().position(Option::is_none) {
            let text = format!("has no value at {}", layout.describe(i));
            return Err(ReadError::new(path, text));
        }
        Ok(one.values.iter().flatten().copied().collect())
    }

    /// Reads replicated measurements.
    pub fn measurements(
        &self,
        open: Open,
        source: &MeasurementSource<'_>,
    ) -> Result<Measurements, ReadError> {
        let layout = source.layout;
        let mut replicates = Vec::new();
        let mut reached = vec![false; layout.len()];
        let files = self.sources(source.directory, source.scenario)?;
        let mut wrong = Vec::new();
        for (name, path) in &files {
            let read =
                open(path).and_then(|store| Reading::new(self, &*store, layout)?.replicates());
            match read {
                Ok(mut read) => {
                    if let (Some(name), [one]) = (name, &mut read.replicates[..]) {
                        one.name.clone_from(name);
                    } else if let Some(name) = name {
                        let count = read.replicates.len();
                        let text = format!("expected the one replicate `{name}`, found {count}");
                        wrong.push(ReadError::new(path, text));
                    }
                    replicates.extend(read.replicates);
                    reached.iter_mut().zip(read.reached).for_each(|(all, own)| *all |= own);
                }
                Err(error) => wrong.push(error),
            }
        }
        if let Some(error) = ReadError::of_all(wrong) {
            return Err(error);
        }
        if let Some(i) = reached.iter().position(|reached| !reached) {
            let more = reached.iter().filter(|reached| !**reached).count() - 1;
            let more = if more == 0 { String::new() } else { format!(" and {more} more values") };
            let text = format!("no record reaches {}{more}", layout.describe(i));
            return Err(ReadError::new(&files[0].1, text).help(
                "a shorter axis of the response, or another `trigger`, `first` or `resample`",
            ));
        }
        Ok(Measurements::new(layout.clone(), replicates))
    }

    /// Reads the numbers of an axis at which records were taken.
    pub fn grid(&self, open: Open, source: &GridSource<'_>) -> Result<Vec<f64>, ReadError> {
        let refuse = |text: &str| {
            ReadError::new(source.directory, text)
                .help(format!("write the numbers of the axis `{}` in the study", source.axis))
        };
        if self.resample != Resample::Exact {
            return Err(refuse("records that are resampled do not tell the numbers of an axis"));
        }
        let Some(time) = &self.time else {
            return Err(refuse("the options name no dataset `time` with the numbers of an axis"));
        };
        let mut numbers = Vec::new();
        for (_, path) in self.sources(source.directory, source.scenario)? {
            let store = open(&path)?;
            let names: Vec<String> = if time.contains(REPLICATE) {
                let all = store.names().iter();
                all.filter(|name| captured(time, name).is_some()).cloned().collect()
            } else {
                vec![time.clone()]
            };
            if names.is_empty() {
                let text = format!("has no dataset `{time}`; it has {}", listed(store.names()));
                return Err(ReadError::new(&path, text));
            }
            for name in names {
                let array = store::array(&*store, &name)?;
                let unit = self.time_unit.as_ref();
                numbers.extend(read::converted(&path, &name, array, unit, source.unit)?);
            }
        }
        if let Some(x) = numbers.iter().find(|x| !x.is_finite()) {
            return Err(refuse(&format!("`{time}` holds {x}")));
        }
        numbers.sort_by(f64::total_cmp);
        numbers.dedup();
        Ok(numbers)
    }

    /// Files that the options name.
    pub fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
        let mut files = Vec::new();
        match &self.path {
            Some(path) if in_path(path) => {
                let found = replicate_files(directory, path, scenario).1;
                files.extend(found.into_iter().map(|(_, path)| path));
            }
            Some(path) => files.push(scenario_path(directory, path, scenario)),
            None => (),
        }
        if let Some(table) = &self.runs {
            let table = scenario_path(directory, table, scenario);
            files.extend(runs::named_files(&table));
            files.push(table);
        }
        files
    }

    /// The files of measurements of a scenario, each with the name of its replicate if it holds one.
    fn sources(
        &self,
        directory: &Path,
        scenario: Option<&str>,
    ) -> Result<Vec<(Option<String>, PathBuf)>, ReadError> {
        let path = self.path.as_ref().ok_or_else(|| {
            ReadError::new(directory, "there is no file of measurements")
                .help("name it with `path`")
        })?;
        if scenario.is_some() && !scenario::each_has_its_file(path) {
            let text = "the study has scenarios, and `path` is the same for all";
            return Err(ReadError::new(directory.join(path), text)
                .help(format!("write `{}` where the names of the files differ", scenario::PLACE)));
        }
        if !in_path(path) {
            return Ok(vec![(None, scenario_path(directory, path, scenario))]);
        }
        let (path, files) = replicate_files(directory, path, scenario);
        if files.is_empty() {
            let text = format!("there is no such file: `{REPLICATE}` is the name of a replicate");
            return Err(ReadError::new(path, text));
        }
        Ok(files.into_iter().map(|(name, file)| (Some(name), file)).collect())
    }
}

fn in_path(path: &Path) -> bool {
    path.to_str().is_some_and(|text| text.contains(REPLICATE))
}

/// The files of a pattern with `{replicate}` in its last part, with the names of the replicates, in order; and the pattern
/// for messages.
fn replicate_files(
    directory: &Path,
    path: &Path,
    scenario: Option<&str>,
) -> (PathBuf, Vec<(String, PathBuf)>) {
    let pattern = scenario_path(directory, path, scenario);
    let (Some(name), Some(folder)) =
        (pattern.file_name().and_then(|n| n.to_str()), pattern.parent())
    else {
        return (pattern, Vec::new());
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<(String, PathBuf)> = entries
        .filter_map(|entry| {
            let replicate = captured(name, entry.file_name().to_str()?)?;
            Some((replicate, entry.path()))
        })
        .collect();
    files.sort_by(|(a, _), (b, _)| by_number(a, b));
    (pattern, files)
}
