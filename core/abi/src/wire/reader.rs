//! The sources of readers, and their results beside the numbers.

use std::path::{Path, PathBuf};

use lacuna::data::table::Column;
use lacuna::data::{FailedRun, Layout, Measurements, Parameter, Table, Unit};
use lacuna::matrix::Matrix;
use lacuna::plugin::reader::{
    Contents, EnsembleSource, GridSource, MeasurementSource, ReadError, Variable,
};
use serde::{Deserialize, Serialize};

/// Source of a reader of any kind; each kind uses the fields it needs.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct OwnedSource {
    /// The folder of the study file.
    pub directory: PathBuf,
    /// Requested scenario.
    pub scenario: Option<String>,
    /// The folder that the simulate stage filled.
    pub simulated: Option<PathBuf>,
    /// The study's parameters.
    pub parameters: Vec<Parameter>,
    /// The shape of a response.
    pub layout: Option<Layout>,
    /// The name of an axis.
    pub axis: String,
    /// Unit in which the axis coordinates are requested.
    pub unit: Option<Unit>,
}

impl OwnedSource {
    /// A folder and a scenario.
    pub fn of(directory: &Path, scenario: Option<&str>) -> Self {
        Self {
            directory: directory.to_owned(),
            scenario: scenario.map(str::to_owned),
            ..Self::default()
        }
    }

    /// The source of an ensemble.
    pub fn ensemble(&self) -> Option<EnsembleSource<'_>> {
        Some(EnsembleSource {
            directory: &self.directory,
            simulated: self.simulated.as_deref(),
            parameters: &self.parameters,
            scenario: self.scenario.as_deref(),
            layout: self.layout.as_ref()?,
        })
    }

    /// The source of measurements.
    pub fn measurements(&self) -> Option<MeasurementSource<'_>> {
        let (directory, scenario) = (&*self.directory, self.scenario.as_deref());
        Some(MeasurementSource { directory, scenario, layout: self.layout.as_ref()? })
    }

    /// The source of the numbers of an axis.
    pub fn grid(&self) -> Option<GridSource<'_>> {
        let (directory, scenario) = (&*self.directory, self.scenario.as_deref());
        Some(GridSource { directory, scenario, axis: &self.axis, unit: self.unit.as_ref()? })
    }
}

impl From<&EnsembleSource<'_>> for OwnedSource {
    fn from(source: &EnsembleSource<'_>) -> Self {
        Self {
            simulated: source.simulated.map(Path::to_owned),
            parameters: source.parameters.to_vec(),
            layout: Some(source.layout.clone()),
            ..Self::of(source.directory, source.scenario)
        }
    }
}

impl From<&MeasurementSource<'_>> for OwnedSource {
    fn from(source: &MeasurementSource<'_>) -> Self {
        Self { layout: Some(source.layout.clone()), ..Self::of(source.directory, source.scenario) }
    }
}

impl From<&GridSource<'_>> for OwnedSource {
    fn from(source: &GridSource<'_>) -> Self {
        Self {
            axis: source.axis.to_owned(),
            unit: Some(source.unit.clone()),
            ..Self::of(source.directory, source.scenario)
        }
    }
}

/// An ensemble without its numbers.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct EnsembleAbout {
    /// The name of each run.
    pub runs: Vec<String>,
    /// True for each run inside the model's range of validity; empty if all runs are.
    pub valid: Vec<bool>,
    /// Runs that failed and are excluded.
    pub failed: Vec<FailedRun>,
}

/// Names of the replicates and flags, transferred beside the values of measurements.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(untagged)]
pub enum MeasuredAbout {
    /// The names of the replicates; the data do not state their noise.
    Names(Vec<String>),
    /// The stated noise, where the data state it.
    Stated {
        /// The names of the replicates.
        replicates: Vec<String>,
        /// True where standard deviations follow the values.
        #[serde(default)]
        sd: bool,
        /// True where a covariance follows those.
        #[serde(default)]
        covariance: bool,
    },
}

impl MeasuredAbout {
    /// The names and marks of measurements.
    pub fn of(measurements: &Measurements) -> Self {
        let replicates = measurements.replicates.iter().map(|r| r.name.clone()).collect();
        let sd = measurements.replicates.iter().any(|r| r.sd.is_some());
        match (sd, measurements.covariance.is_some()) {
            (false, false) => Self::Names(replicates),
            (sd, covariance) => Self::Stated { replicates, sd, covariance },
        }
    }

    /// The names of the replicates, and whether standard deviations and a covariance follow the values.
    pub fn parts(self) -> (Vec<String>, bool, bool) {
        match self {
            Self::Names(replicates) => (replicates, false, false),
            Self::Stated { replicates, sd, covariance } => (replicates, sd, covariance),
        }
    }
}

/// Why a file cannot be read.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct FailureAbout {
    path: PathBuf,
    place: String,
    message: String,
    help: Option<String>,
    further: Vec<FailureAbout>,
}

impl FailureAbout {
    /// The error that a text means: a JSON object, or a message about `path`. `who` says it.
    pub fn read(text: &str, path: &Path, who: &str) -> ReadError {
        let plain = || Self { path: path.to_owned(), message: text.to_owned(), ..Self::default() };
        let told: Self = serde_json::from_str(text).unwrap_or_else(|_| plain());
        let message = format!("{who}: {}", told.message);
        let about = Self { message, ..told };
        about.error()
    }

    fn error(self) -> ReadError {
        ReadError {
            path: self.path,
            place: self.place,
            message: self.message,
            help: self.help,
            further: self.further.into_iter().map(Self::error).collect(),
        }
    }
}

/// The contents of a file, without the numbers.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ContentsAbout {
    format: String,
    facts: Vec<(String, String)>,
    variables: Vec<VariableAbout>,
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
struct VariableAbout {
    name: String,
    on: String,
    axes: Vec<(String, usize)>,
    unit: Option<Unit>,
    range: Option<(f64, f64)>,
    not_finite: usize,
    columns: Vec<ColumnAbout>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct ColumnAbout {
    name: String,
    #[serde(default)]
    unit: Option<Unit>,
}

impl ContentsAbout {
    /// Contents as text, and the columns of each variable as a matrix.
    pub fn take_apart(contents: Contents) -> (Self, Vec<Matrix>) {
        let (mut variables, mut matrices) = (Vec::new(), Vec::new());
        for variable in contents.variables {
            let columns = variable.signals.columns;
            let rows = columns.first().map_or(0, |column| column.values.len());
            matrices.push(Matrix::from_fn(rows, columns.len(), |i, j| columns[j].values[i]));
            let about = |column: Column| ColumnAbout { name: column.name, unit: column.unit };
            variables.push(VariableAbout {
                name: variable.name,
                on: variable.on,
                axes: variable.axes,
                unit: variable.unit,
                range: variable.range,
                not_finite: variable.not_finite,
                columns: columns.into_iter().map(about).collect(),
            });
        }
        (Self { format: contents.format, facts: contents.facts, variables }, matrices)
    }

    /// The contents; `None` where the matrices are not those of the variables.
    pub fn put_together(self, matrices: &[Matrix]) -> Option<Contents> {
        if matrices.len() != self.variables.len() {
            return None;
        }
        let variable = |(about, matrix): (VariableAbout, &Matrix)| {
            if about.columns.len() != matrix.columns() {
                return None;
            }
            let column = |(j, column): (usize, ColumnAbout)| Column {
                name: column.name,
                unit: column.unit,
                values: matrix.column(j),
            };
            let columns = about.columns.into_iter().enumerate().map(column).collect();
            Some(Variable {
                name: about.name,
                on: about.on,
                axes: about.axes,
                unit: about.unit,
                range: about.range,
                not_finite: about.not_finite,
                signals: Table { columns },
            })
        };
        let variables: Option<Vec<Variable>> =
            self.variables.into_iter().zip(matrices).map(variable).collect();
        Some(Contents { format: self.format, facts: self.facts, variables: variables? })
    }
}
