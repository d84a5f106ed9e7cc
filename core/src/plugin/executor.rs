//! Executors: where many model evaluations run.

use std::path::{Path, PathBuf};

use super::Component;
use super::model::{Call, Model, Response};
use crate::data::{Layout, Scenario, Unit};
use crate::run::Stop;

/// Runs many model evaluations somewhere.
pub trait Executor: Component {
    /// Runs the jobs and hands over each as it finishes, in any order. A job that fails is data; an error
    /// means that the executor itself cannot go on (jobs handed over before stay done).
    fn submit(
        &self,
        batch: &Batch<'_>,
        finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
    ) -> Result<(), Stop>;
}

/// Jobs that belong together.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    /// The model that all jobs evaluate.
    pub model: &'a dyn Model,
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

/// One evaluation.
#[derive(Debug, Clone, PartialEq)]
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
    /// The response with the name of the file that holds it, or why there is none.
    pub outcome: Result<(Response, String), String>,
    /// How long it took, in seconds.
    pub seconds: f64,
}
