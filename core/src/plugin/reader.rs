//! Readers: from files to data.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Component;
use crate::data::{Ensemble, Layout, Measurements, Parameter, Table, Unit};

/// Reads files of one family of formats.
///
/// A reader offers what its formats can hold; the other methods say so in their error.
pub trait Reader: Component {
    /// Whether this reader understands a file, judged by its first bytes (at most 4096) and its name.
    fn recognises(&self, path: &Path, head: &[u8]) -> bool;

    /// What is in a file, for `lacuna inspect`.
    fn inspect(&self, path: &Path) -> Result<Contents, ReadError>;

    /// Whether the options name files of the user's own; if not, [`Reader::ensemble`] reads the files
    /// that the study's simulate stage wrote.
    fn names_files(&self) -> bool;

    /// Simulation runs with their parameters.
    fn ensemble(&self, source: &EnsembleSource<'_>) -> Result<Ensemble, ReadError> {
        Err(ReadError::new(source.directory, "this reader does not read simulation runs"))
    }

    /// How many of so many runs may fail, where the options say it.
    fn allowed_failures(&self, _runs: usize) -> Option<usize> {
        None
    }

    /// Replicated measurements.
    fn measurements(&self, source: &MeasurementSource<'_>) -> Result<Measurements, ReadError> {
        Err(ReadError::new(source.directory, "this reader does not read measurements"))
    }

    /// The numbers of an axis at which a scenario was measured, increasing: those of all its replicates.
    fn grid(&self, source: &GridSource<'_>) -> Result<Vec<f64>, ReadError> {
        let text = "this reader does not tell where the measurements were taken";
        Err(ReadError::new(source.directory, text))
    }

    /// One response from one file, such as the output of an external simulator.
    fn response(&self, path: &Path, _layout: &Layout) -> Result<Vec<f64>, ReadError> {
        Err(ReadError::new(path, "this reader does not read a single response"))
    }

    /// The files that the options name (for the hash of a stage's inputs), relative paths resolved
    /// against `directory`, for one scenario (`None` in a study without). Folders stand for all files
    /// directly in them.
    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf>;
}

/// Where an ensemble comes from.
#[derive(Debug, Clone, Copy)]
pub struct EnsembleSource<'a> {
    /// The folder of the study file; relative paths in the options start here.
    pub directory: &'a Path,
    /// The folder that the simulate stage filled, if the study simulates: a table `runs.csv` with the columns
    /// `run`, `file`, `status` (`done` or `failed`), `valid` (`true` or `false`), `reason` and one a parameter,
    /// and the result files it names.
    pub simulated: Option<&'a Path>,
    /// The study's parameters, in the order of the ensemble's columns.
    pub parameters: &'a [Parameter],
    /// The scenario whose responses are wanted, in a study with scenarios. Where a table has a column
    /// `scenario`, its other rows are of other scenarios; where a path holds `{scenario}`, this name stands there.
    pub scenario: Option<&'a str>,
    /// The shape that each response must have.
    pub layout: &'a Layout,
}

/// Where measurements come from.
#[derive(Debug, Clone, Copy)]
pub struct MeasurementSource<'a> {
    /// The folder of the study file; relative paths in the options start here.
    pub directory: &'a Path,
    /// The scenario whose measurements are wanted; see [`EnsembleSource::scenario`].
    pub scenario: Option<&'a str>,
    /// The shape that a complete measurement has.
    pub layout: &'a Layout,
}

/// Where the numbers of an axis come from.
#[derive(Debug, Clone, Copy)]
pub struct GridSource<'a> {
    /// The folder of the study file; relative paths in the options start here.
    pub directory: &'a Path,
    /// The scenario; see [`EnsembleSource::scenario`].
    pub scenario: Option<&'a str>,
    /// The name of the axis.
    pub axis: &'a str,
    /// The unit in which the numbers are wanted.
    pub unit: &'a Unit,
}

/// A path of the options for one scenario: its name in the place of `{scenario}`.
pub fn scenario_path(directory: &Path, path: &Path, scenario: Option<&str>) -> PathBuf {
    match (scenario, path.to_str()) {
        (Some(name), Some(text)) => directory.join(text.replace("{scenario}", name)),
        _ => directory.join(path),
    }
}

/// What a reader sees in a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Contents {
    /// The format in words, such as `Exodus II history, 64-bit offset netCDF`.
    pub format: String,
    /// Facts about the whole file: name and value.
    pub facts: Vec<(String, String)>,
    /// What can be read.
    pub variables: Vec<Variable>,
}

/// A variable in a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// What it belongs to, such as `global`, `element block 3`, `column`.
    pub on: String,
    /// The lengths of its axes with their names.
    pub axes: Vec<(String, usize)>,
    /// Its unit, where the file says.
    pub unit: Option<Unit>,
    /// Its smallest and largest finite value, where it is numeric.
    pub range: Option<(f64, f64)>,
    /// How many of its values are not finite.
    pub not_finite: usize,
    /// The variable as columns (time or another axis first), for `--variable NAME --csv OUT`.
    pub signals: Table,
}

/// A file that cannot be read, or does not hold what the study needs.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", self.render())]
pub struct ReadError {
    /// The file or folder.
    pub path: PathBuf,
    /// Where in it, such as `line 3, column 2` or ``variable `strain_B` ``; empty for the whole.
    pub place: String,
    /// What is wrong, with the value found and what would be right.
    pub message: String,
    /// What to do about it.
    pub help: Option<String>,
    /// What else is wrong with the same files, in the order of the files.
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

    /// All of a list as one error; `None` when there is none.
    pub fn of_all(errors: impl IntoIterator<Item = Self>) -> Option<Self> {
        let mut each = errors.into_iter().flat_map(Self::into_each);
        let first = each.next()?;
        Some(Self { further: each.collect(), ..first })
    }

    /// Each error alone.
    pub fn into_each(mut self) -> Vec<Self> {
        let further = std::mem::take(&mut self.further);
        std::iter::once(self).chain(further.into_iter().flat_map(Self::into_each)).collect()
    }

    /// The same error at a place in the file.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = place.into();
        self
    }

    /// The same error with advice.
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
