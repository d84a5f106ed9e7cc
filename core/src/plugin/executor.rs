//! Executors: where many model evaluations run.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Component;
use super::abi::{Library, library};
use super::model::{Call, Model};
use super::registry::{self, Built};
use crate::data::{Layout, Scenario, Unit};
use crate::run::Stop;
use crate::study::emit;

/// Runs many model evaluations somewhere.
pub trait Executor: Component {
    /// Runs the jobs and hands over each as it finishes, in any order. A job that fails is data; an error
    /// means that the executor itself cannot go on (jobs handed over before stay done).
    fn submit(
        &self,
        batch: &Batch<'_>,
        finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
    ) -> Result<(), Stop>;

    /// Whether [`Executor::submit`] only waits for jobs that run somewhere else, so that several batches may wait at
    /// the same time.
    fn waits(&self) -> bool {
        false
    }

    /// What is known of the jobs in the folder of a batch that run or wait somewhere else, though no process of
    /// this program waits for them; nothing where jobs end with the process that made them.
    fn look(&self, _directory: &Path) -> Result<Vec<Seen>, Stop> {
        Ok(Vec::new())
    }

    /// Ends the jobs of a batch's folder that run or wait somewhere else; returns how many runs that stops.
    fn cancel(&self, _directory: &Path) -> Result<usize, Stop> {
        Ok(0)
    }
}

/// A job that is somewhere else.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// Its name.
    pub run: String,
    /// How far it is.
    pub phase: Phase,
    /// Where it is and why, in words.
    pub note: String,
}

/// How far a job is that is somewhere else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// It waits in a queue.
    Waits,
    /// It runs.
    Runs,
    /// It has ended, or nobody knows of it any more.
    Ended,
}

/// Jobs that belong together.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    /// The model that all jobs evaluate.
    pub model: &'a dyn Model,
    /// How another process builds that model.
    pub recipe: &'a Recipe,
    /// The name of each of its inputs.
    pub names: &'a [String],
    /// The unit of each.
    pub units: &'a [Unit],
    /// The jobs.
    pub jobs: &'a [Job],
    /// The shape of the response that is wanted.
    pub layout: &'a Layout,
    /// The conditions of all jobs.
    pub scenario: &'a Scenario,
    /// The folder of the study file.
    pub study: &'a Path,
    /// The folder into which result files are written.
    pub directory: &'a Path,
    /// Tells whoever watches something that a person should know while the jobs are made.
    pub warn: &'a (dyn Fn(&str) + Sync),
}

impl<'a> Batch<'a> {
    /// The folder in which a model may keep files of a job.
    pub fn folder(&self, job: &Job) -> PathBuf {
        self.directory.join(&job.name)
    }

    /// What is asked of the model for a job whose own folder is `folder`.
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

/// What a process needs to build a model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The name of its plugin.
    #[serde(rename = "use")]
    pub name: String,
    /// All its options as TOML, which keeps every number that JSON does not have.
    pub options: String,
    /// The libraries of plugins that are loaded first: that of the model, and those of its parts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub libraries: Vec<LibraryFile>,
}

/// A library of plugins as another process finds it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LibraryFile {
    /// Its file.
    pub path: PathBuf,
    /// The SHA-256 that it must have.
    pub sha256: String,
}

impl Recipe {
    /// How a model was built, with the libraries that it needs.
    pub fn of(built: &Built<dyn Model>) -> Result<Self, Stop> {
        let options = emit::to_toml(&built.options).map_err(|error| {
            Stop::new(format!("cannot write the options of `{}`: {error}", built.name))
        })?;
        let file = |l: &Library| LibraryFile { path: l.path.clone(), sha256: l.sha256.clone() };
        let libraries = built.libraries().into_iter().map(file).collect();
        Ok(Self { name: built.name.to_owned(), options, libraries })
    }

    /// The model.
    pub fn build(&self) -> Result<Box<dyn Model>, Stop> {
        for LibraryFile { path, sha256 } in &self.libraries {
            library::load(path, Some(sha256)).map_err(|error| Stop::new(unusable(path, &error)))?;
        }
        let built = registry::from_text::<dyn Model>(&self.name, &self.options);
        built.map(|built| built.plugin).map_err(|complaints| {
            Stop::new(format!("the model `{}` cannot be built:\n{complaints}", self.name))
        })
    }
}

/// That a library cannot be used, and why.
fn unusable(path: &Path, reason: &str) -> String {
    format!("the library of plugins {} cannot be used: {reason}", path.display())
}

/// One evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Its name, which is also the stem of its result file.
    pub name: String,
    /// One value an input of the model.
    pub inputs: Vec<f64>,
}

/// A job that has ended.
#[derive(Debug)]
pub struct Finished {
    /// Its index in the batch.
    pub index: usize,
    /// The response as it was written down, or why there is none.
    pub outcome: Result<Written, String>,
    /// How long it took, in seconds.
    pub seconds: f64,
}

/// A response that was written down.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Written {
    /// The file in the folder of the batch.
    pub file: String,
    /// Whether the run stayed inside the model's range of validity.
    pub valid: bool,
}
