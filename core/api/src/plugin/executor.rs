//! Executors: processes and machines on which model evaluations run.

use std::path::{Path, PathBuf};

use lacuna_base::data::{Layout, Scenario, Unit};
use lacuna_base::run::Stop;
use lacuna_base::text::emit;
use serde::{Deserialize, Serialize};

use super::model::{Call, Model};
use super::registry::{self, Built};
use super::{Component, Library};

/// Runs many model evaluations.
pub trait Executor: Component {
    /// Runs the jobs and passes on each result as it finishes, in any order. A failed job is a result.
    ///
    /// # Errors
    /// If the executor itself cannot continue; results passed on before remain valid.
    fn submit(
        &self,
        batch: &Batch<'_>,
        finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
    ) -> Result<(), Stop>;

    /// Returns true if [`Executor::submit`] only waits for jobs that run elsewhere, so that several batches may wait at
    /// the same time.
    fn waits(&self) -> bool {
        false
    }

    /// Jobs of a batch's folder that run or are queued elsewhere although no process of this program waits for them;
    /// empty if jobs end with the process that started them.
    fn look(&self, _directory: &Path) -> Result<Vec<Seen>, Stop> {
        Ok(Vec::new())
    }

    /// Cancels the jobs of a batch's folder that run or are queued elsewhere; returns the number of runs that this
    /// stops.
    fn cancel(&self, _directory: &Path) -> Result<usize, Stop> {
        Ok(0)
    }
}

/// A job that runs or is queued elsewhere.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// Name of the run.
    pub run: String,
    /// State of the job.
    pub phase: Phase,
    /// Location and reason of the state, as text.
    pub note: String,
}

/// State of a job that runs or is queued elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Waiting in a queue.
    Waits,
    /// Running.
    Runs,
    /// Ended, or no longer known to the scheduler.
    Ended,
}

/// Jobs that are submitted together.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    /// Model that all jobs evaluate.
    pub model: &'a dyn Model,
    /// Description from which another process builds the model.
    pub recipe: &'a Recipe,
    /// Names of the model's inputs.
    pub names: &'a [String],
    /// Units of the model's inputs.
    pub units: &'a [Unit],
    /// Jobs.
    pub jobs: &'a [Job],
    /// Layout of the requested response.
    pub layout: &'a Layout,
    /// Conditions of all jobs.
    pub scenario: &'a Scenario,
    /// Folder of the study file.
    pub study: &'a Path,
    /// Folder into which result files are written.
    pub directory: &'a Path,
    /// Receives warnings while the jobs run.
    pub warn: &'a (dyn Fn(&str) + Sync),
}

impl<'a> Batch<'a> {
    /// Folder in which a model may keep files of a job.
    pub fn folder(&self, job: &Job) -> PathBuf {
        self.directory.join(&job.name)
    }

    /// The call of the model for a job whose own folder is `folder`.
    pub fn call(&self, job: &'a Job, folder: &'a Path) -> Call<'a> {
        Call {
            inputs: &job.inputs,
            names: self.names,
            units: self.units,
            layout: self.layout,
            scenario: self.scenario,
            study: self.study,
            directory: Some(folder),
        }
    }
}

/// Description from which a process builds a model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Name of the model's plugin.
    #[serde(rename = "use")]
    pub name: String,
    /// All options as TOML, which can represent every number, unlike JSON.
    pub options: String,
    /// Libraries of plugins that must be loaded first: that of the model, and those of its parts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub libraries: Vec<LibraryFile>,
}

/// A library of plugins, as another process finds it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LibraryFile {
    /// Path of the library.
    pub path: PathBuf,
    /// SHA-256 that the file must have.
    pub sha256: String,
}

impl Recipe {
    /// The recipe of a model that has been built.
    pub fn of(built: &Built<dyn Model>) -> Result<Self, Stop> {
        let options = emit::to_toml(&built.options).map_err(|error| {
            Stop::new(format!("cannot write the options of `{}`: {error}", built.name))
        })?;
        let file = |l: &Library| LibraryFile { path: l.path.clone(), sha256: l.sha256.clone() };
        let libraries = built.libraries().into_iter().map(file).collect();
        Ok(Self { name: built.name.to_owned(), options, libraries })
    }

    /// Builds the model; `load` loads the libraries that contain its plugins.
    pub fn build(&self, load: &Load<'_>) -> Result<Box<dyn Model>, Stop> {
        for LibraryFile { path, sha256 } in &self.libraries {
            load(path, Some(sha256)).map_err(|error| Stop::new(unusable(path, &error)))?;
        }
        let built = registry::from_text::<dyn Model>(&self.name, &self.options);
        built.map(|built| built.plugin).map_err(|complaints| {
            Stop::new(format!("the model `{}` cannot be built:\n{complaints}", self.name))
        })
    }
}

/// Loads the library of plugins at a path; if a SHA-256 is given, the file must have it. The error describes what is
/// wrong with the library.
pub type Load<'a> = dyn Fn(&Path, Option<&str>) -> Result<&'static Library, String> + 'a;

/// Message for a library that cannot be used.
fn unusable(path: &Path, reason: &str) -> String {
    format!("the library of plugins {} cannot be used: {reason}", path.display())
}

/// One evaluation of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Name of the job, which is also the stem of its result file.
    pub name: String,
    /// One value per input of the model.
    pub inputs: Vec<f64>,
}

/// A job that has ended.
#[derive(Debug)]
pub struct Finished {
    /// Index of the job in the batch.
    pub index: usize,
    /// The response as written to a file, or the reason why there is none.
    pub outcome: Result<Written, String>,
    /// Duration of the job, in seconds.
    pub seconds: f64,
}

/// A response that has been written to a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Written {
    /// Name of the file in the folder of the batch.
    pub file: String,
    /// True if the run stayed inside the model's range of validity.
    pub valid: bool,
}
