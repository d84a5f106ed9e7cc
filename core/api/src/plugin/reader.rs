//! Readers: from files to data.

use std::path::{Path, PathBuf};

use lacuna_base::data::{Ensemble, Layout, Measurements, Parameter, Table, Unit};
use lacuna_base::run::Stop;
use thiserror::Error;

use super::Component;

/// Reads files of one family of formats.
///
/// A reader implements the methods that its formats support; the others return an error that says so.
pub trait Reader: Component {
    /// Returns true if this reader understands a file, judged by its first bytes (at most 4096) and its name.
    fn recognises(&self, path: &Path, head: &[u8]) -> bool;

    /// Lists the contents of a file, for `lacuna inspect`.
    fn inspect(&self, path: &Path) -> Result<Contents, ReadError>;

    /// Returns true if the options name files of the user's own; otherwise [`Reader::ensemble`] reads the files that
    /// the study's simulate stage wrote.
    fn names_files(&self) -> bool;

    /// Reads simulation runs with their parameters.
    fn ensemble(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
        Err(ReadError::new(source.directory, "this reader does not read simulation runs"))
    }

    /// Number of runs, out of `runs`, that may fail; `None` if the options do not say.
    fn allowed_failures(&self, _runs: usize) -> Option<usize> {
        None
    }

    /// Reads replicated measurements.
    fn measurements(&self, source: &MeasurementSource<'_>) -> Result<Measurements, ReadError> {
        Err(ReadError::new(source.directory, "this reader does not read measurements"))
    }

    /// Numbers of an axis at which a scenario was measured, increasing, merged over all its replicates.
    fn grid(&self, source: &GridSource<'_>) -> Result<Vec<f64>, ReadError> {
        let text = "this reader does not tell where the measurements were taken";
        Err(ReadError::new(source.directory, text))
    }

    /// Groups by which the measurements are divided, if the options name the column that holds them: each is a scenario of a
    /// study that writes none.
    fn groups(&self, _directory: &Path) -> Result<Option<Groups>, ReadError> {
        Ok(None)
    }

    /// Reads one response from one file, such as the output of an external simulator.
    fn response(&self, path: &Path, _layout: &Layout) -> Result<Vec<f64>, ReadError> {
        Err(ReadError::new(path, "this reader does not read a single response"))
    }

    /// Files that the options name (for the hash of a stage's inputs) for one scenario (`None` in a study without
    /// scenarios); relative paths are resolved against `directory`. A folder stands for all files directly inside it.
    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf>;
}

/// Groups of measurements, such as the targets at which they were taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Groups {
    /// Kind of group: `target`.
    pub label: String,
    /// Names of the groups, in the order of the measurements.
    pub names: Vec<String>,
}

/// Source of an ensemble.
#[derive(Debug, Clone, Copy)]
pub struct EnsembleSource<'a> {
    /// Folder of the study file; relative paths in the options start here.
    pub directory: &'a Path,
    /// Folder that the simulate stage filled, if the study simulates: a table `runs.csv` with the columns `run`,
    /// `file`, `status` (`done` or `failed`), `valid` (`true` or `false`), `reason` and one per parameter, and the
    /// result files that it names.
    pub simulated: Option<&'a Path>,
    /// Parameters of the study, in the order of the ensemble's columns.
    pub parameters: &'a [Parameter],
    /// Scenario whose responses are read, in a study with scenarios. If a table has a column `scenario`, its other rows
    /// belong to other scenarios; in a path, `{scenario}` is replaced by this name.
    pub scenario: Option<&'a str>,
    /// Layout that each response must have.
    pub layout: &'a Layout,
}

/// Source of measurements.
#[derive(Debug, Clone, Copy)]
pub struct MeasurementSource<'a> {
    /// Folder of the study file; relative paths in the options start here.
    pub directory: &'a Path,
    /// Scenario whose measurements are read; see [`EnsembleSource::scenario`].
    pub scenario: Option<&'a str>,
    /// Layout of a complete measurement.
    pub layout: &'a Layout,
}

/// Source of the numbers of an axis.
#[derive(Debug, Clone, Copy)]
pub struct GridSource<'a> {
    /// Folder of the study file; relative paths in the options start here.
    pub directory: &'a Path,
    /// Scenario; see [`EnsembleSource::scenario`].
    pub scenario: Option<&'a str>,
    /// Name of the axis.
    pub axis: &'a str,
    /// Unit of the requested numbers.
    pub unit: &'a Unit,
}

/// A path of the options for one scenario: `{scenario}` is replaced by its name.
pub fn scenario_path(directory: &Path, path: &Path, scenario: Option<&str>) -> PathBuf {
    match (scenario, path.to_str()) {
        (Some(name), Some(text)) => directory.join(text.replace("{scenario}", name)),
        _ => directory.join(path),
    }
}

/// Contents of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Contents {
    /// Description of the format, such as `Exodus II history, 64-bit offset netCDF`.
    pub format: String,
    /// Facts about the whole file: name and value.
    pub facts: Vec<(String, String)>,
    /// Variables that can be read.
    pub variables: Vec<Variable>,
}

/// A variable in a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Variable {
    /// Name of the variable.
    pub name: String,
    /// Object that the variable belongs to, such as `global`, `element block 3`, `column`.
    pub on: String,
    /// Names and lengths of its axes.
    pub axes: Vec<(String, usize)>,
    /// Unit; `None` if the file states none.
    pub unit: Option<Unit>,
    /// Smallest and largest finite value of a numeric variable.
    pub range: Option<(f64, f64)>,
    /// Number of values that are not finite.
    pub not_finite: usize,
    /// The variable as columns (time or another axis first), for `--variable NAME --csv OUT`.
    pub signals: Table,
}

/// A file cannot be read, or does not contain what the study needs.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", self.render())]
pub struct ReadError {
    /// File or folder.
    pub path: PathBuf,
    /// Place in the file, such as `line 3, column 2` or ``variable `strain_B` ``; empty for the whole file.
    pub place: String,
    /// Description of the problem, with the value found and the correct form.
    pub message: String,
    /// Advice to the user.
    pub help: Option<String>,
    /// Further errors in the same files, in the order of the files.
    pub further: Vec<ReadError>,
}

impl ReadError {
    /// An error about a whole file.
    pub fn new(path: impl Into<PathBuf>, message: impl Into<String>) -> Self {
        Self {
            path: path.into(),
            place: String::new(),
            message: message.into(),
            help: None,
            further: Vec::new(),
        }
    }

    /// Combines a list of errors into one; `None` if the list is empty.
    pub fn of_all(errors: impl IntoIterator<Item = Self>) -> Option<Self> {
        let mut each = errors.into_iter().flat_map(Self::into_each);
        let first = each.next()?;
        Some(Self { further: each.collect(), ..first })
    }

    /// Splits into the individual errors.
    pub fn into_each(mut self) -> Vec<Self> {
        let further = std::mem::take(&mut self.further);
        std::iter::once(self).chain(further.into_iter().flat_map(Self::into_each)).collect()
    }

    /// Sets the place in the file.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = place.into();
        self
    }

    /// Adds advice.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    fn render(&self) -> String {
        let place = if self.place.is_empty() { String::new() } else { format!(", {}", self.place) };
        let help = self.help.as_ref().map_or(String::new(), |h| format!("\nhelp: {h}"));
        let mut text = format!("{}{place}: {}{help}", self.path.display(), self.message);
        self.further.iter().for_each(|error| text.push_str(&format!("\n{error}")));
        text
    }
}

impl From<ReadError> for Stop {
    fn from(error: ReadError) -> Self {
        Self::new(error.to_string())
    }
}
