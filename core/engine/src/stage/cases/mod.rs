//! Cases of a stage: parts of its work that do not depend on each other, such as the truths of `coverage`.
//!
//! Threads of this process compute them, or the executor of `[cases]` in other processes and on other machines. There a case
//! is a job like a run of the simulator, of a model whose only input is the number of the case and that answers in a file. A
//! process that has such a job reads the finished stages in the run directory, beside the process that asked, and
//! computes the case as a thread of that one would.

mod runner;
mod spread;
mod task;
mod visit;

use std::path::Path;

use lacuna::data::{Layout, Scenario};
use lacuna::plugin::executor::{Batch, Executor, Finished, Job, Recipe};
use lacuna::plugin::registry::Built;
use lacuna::run::{Observer, Stop, files};
use lacuna_run::work::Marker;
use lacuna_run::{Folder, Stage};
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::stage::simulate::{self, Roll};
use crate::study::Study;
use runner::Runner;
use task::Task;

pub use spread::{Spreading, Visiting};
pub use visit::Visit;

/// Outcome of a case.
pub trait Outcome: Serialize + DeserializeOwned + Send {
    /// False if the case is to be computed again when it is asked for again.
    fn is_settled(&self) -> bool {
        true
    }
}

/// Computes the case with this number.
///
/// # Errors
/// If no case can be computed.
pub type Make<'a, T> = dyn Fn(usize) -> Result<T, Stop> + Sync + 'a;

/// Receives the number of a case and its outcome.
pub type Note<'a, T> = dyn Fn(usize, T) -> Result<(), Stop> + Sync + 'a;

/// Cases of a stage.
pub struct Cases<'a> {
    /// The study.
    pub study: &'a Study,
    /// The stage.
    pub stage: Stage,
    /// Folder of the stage.
    pub folder: &'a Path,
    /// Hash of everything on which the cases depend, except for their numbers.
    pub inputs: &'a str,
    /// Options of the command, which another process needs in addition to the study.
    pub asked: serde_json::Value,
}

impl Cases<'_> {
    /// Computes the cases with these numbers and passes on each as it ends, in any order.
    ///
    /// # Errors
    /// If no case can be computed, or if jobs ended without the outcomes of their cases: once all others have been passed on.
    pub fn compute<T: Outcome>(
        &self,
        numbers: &[usize],
        make: &Make<'_, T>,
        note: &Note<'_, T>,
        observer: &dyn Observer,
    ) -> Result<(), Stop> {
        match &self.study.cases {
            Some(section) if !numbers.is_empty() && section.common.include(self.stage) => {
                self.submit(&section.built, numbers, make, note, observer)
            }
            _ => numbers.par_iter().try_for_each(|&number| note(number, make(number)?)),
        }
    }

    /// Has the cases computed by an executor.
    fn submit<T: Outcome>(
        &self,
        executor: &Built<dyn Executor>,
        numbers: &[usize],
        make: &Make<'_, T>,
        note: &Note<'_, T>,
        observer: &dyn Observer,
    ) -> Result<(), Stop> {
        let folder = self.stage.folder();
        let task = Task::of(self.study, self.inputs, &self.asked)?;
        task.write(self.folder)?;
        let jobs: Vec<Job> = numbers.iter().map(|&number| job(number)).collect();
        self.roll(&jobs, executor)?.write(self.folder)?;
        let batch = Batch {
            model: &Runner { folder: self.folder, make },
            recipe: &recipe(&folder, self.inputs),
            names: &["case".to_owned()],
            units: &[],
            jobs: &jobs,
            layout: &Layout::number("case"),
            scenario: &Scenario::default(),
            study: &self.study.directory,
            directory: self.folder,
            warn: &|text| observer.remark(text),
        };
        let mut log = simulate::Log::open(self.folder)?;
        let (mut ended, mut lost) = (0, Vec::new());
        let submitted = executor.plugin.submit(&batch, &mut |finished: Finished| {
            let Job { name, .. } = &jobs[finished.index];
            match &finished.outcome {
                Ok(written) => {
                    note(
                        numbers[finished.index],
                        files::read_json(&self.folder.join(&written.file))?,
                    )?;
                    if !written.valid {
                        Marker::set_aside(self.folder, name)?;
                    }
                    ended += 1;
                }
                Err(reason) => lost.push((name.clone(), reason.clone())),
            }
            log.note(&simulate::record(name, finished, self.folder)?)
        });
        let there = format!("{ended} of {} cases in {}", numbers.len(), self.folder.display());
        submitted.map_err(|stop| stop.saved(there.clone()))?;
        lost.sort();
        match lost.first() {
            None => Ok(()),
            Some((name, reason)) => Err(Stop::new(format!(
                "{} of {} cases have no outcome; `{name}`: {reason}",
                lost.len(),
                numbers.len()
            ))
            .saved(there)
            .help("the same command computes these cases again, and no others")),
        }
    }

    /// The cases as the runs of a campaign, those of earlier attempts included.
    fn roll(&self, jobs: &[Job], executor: &Built<dyn Executor>) -> Result<Roll, Stop> {
        let mut runs = Roll::read(self.folder)?.map_or_else(Vec::new, |roll| roll.runs);
        runs.extend(jobs.iter().map(|job| job.name.clone()));
        runs.sort();
        runs.dedup();
        Roll::of_cases(runs, executor)
    }
}

/// The job of a case.
fn job(number: usize) -> Job {
    Job { name: format!("case{:05}", number + 1), inputs: vec![number as f64] }
}

/// Description from which [`Visit::of`] finds the cases of a stage. No model has the name of a folder.
fn recipe(stage: &Folder, inputs: &str) -> Recipe {
    let options = format!("inputs = \"{inputs}\"");
    Recipe { name: stage.name().to_owned(), options, libraries: Vec::new() }
}
