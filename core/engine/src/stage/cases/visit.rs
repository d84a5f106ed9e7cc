//! A process that computes cases, in the run directory of the process that asked for them.

use std::path::{Path, PathBuf};

use lacuna::plugin::executor::Recipe;
use lacuna::run::Stop;
use lacuna_run::work::Then;
use lacuna_run::{RunDirectory, Stage};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::runner::Runner;
use super::task::Task;
use super::{Make, Outcome, recipe};
use crate::study::Study;
use crate::study::resolve::{Use, load_text_for};

/// The visit of a process that computes cases of a stage.
pub struct Visit {
    /// The stage.
    pub stage: Stage,
    /// The study.
    pub study: Study,
    /// Folder of the stage.
    folder: PathBuf,
    task: Task,
}

impl Visit {
    /// The visit that an order asks for whose jobs are cases; `None` if they are runs of a model. `folder` is the folder of the
    /// jobs, which is that of the stage.
    pub fn of(order: &Recipe, folder: &Path) -> Result<Option<Self>, Stop> {
        let is_of = |stage: &Stage| order.name == stage.folder().name();
        let Some(stage) = Stage::ALL.into_iter().find(is_of) else { return Ok(None) };
        let task = Task::read(folder)?;
        if *order != recipe(&stage.folder(), &task.inputs) {
            let folder = folder.display();
            return Err(Stop::new(format!("the cases in {folder} are now those of another study"))
                .help("run the command again that asked for these cases"));
        }
        let study = read(folder, &task.study)?;
        Ok(Some(Self { stage, study, folder: folder.to_owned(), task }))
    }

    /// Options of the command that asked, in addition to the study.
    pub fn asked<A: DeserializeOwned>(&self) -> Result<A, Stop> {
        serde_json::from_value(self.task.asked.clone())
            .map_err(|error| Stop::new(format!("the task of the cases cannot be read: {error}")))
    }

    /// The run directory, in which only finished stages can be read.
    pub fn directory(&self) -> Result<RunDirectory, Stop> {
        let mut run = RunDirectory::visit(self.folder.parent().unwrap_or(&self.folder))?;
        run.uses(self.study.libraries.all().map(|library| library.sha256.clone()));
        Ok(run)
    }

    /// Folder of the stage.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Refuses inputs of the cases that are not those of the process that asked.
    pub fn is_of(&self, run: &RunDirectory, inputs: &impl Serialize) -> Result<(), Stop> {
        if run.hash_of(&self.stage.folder(), inputs)? == self.task.inputs {
            return Ok(());
        }
        let text = format!(
            "what the cases in {} depend on is not the same here as where they were asked for",
            self.folder.display()
        );
        Err(Stop::new(text).help("files of the study have changed since: run the command again"))
    }

    /// Hands over the cases of the stage, which depend on these inputs, as a model.
    ///
    /// # Errors
    /// If the inputs are not those of the process that asked.
    pub fn serve<T: Outcome>(
        &self,
        run: &RunDirectory,
        inputs: &impl Serialize,
        make: &Make<'_, T>,
        then: Then<'_>,
    ) -> Result<(), Stop> {
        self.is_of(run, inputs)?;
        self.hand_over(make, then)
    }

    /// Hands over the cases of the stage as a model.
    pub fn hand_over<T: Outcome>(&self, make: &Make<'_, T>, then: Then<'_>) -> Result<(), Stop> {
        let faults = self.study.faults();
        let checked = |number: usize| {
            let made = make(number)?;
            faults
                .iter()
                .find_map(|fault| fault.said())
                .map_or(Ok(made), |said| Err(Stop::new(said)))
        };
        then(&Runner { folder: &self.folder, make: &checked })
    }
}

/// The study of a task. Its executors are not used.
fn read(folder: &Path, text: &str) -> Result<Study, Stop> {
    let path = folder.with_file_name("resolved.toml");
    let checked = load_text_for(&path, text, Use::Look);
    let complaints = checked.complaints();
    let study = checked.study.ok_or_else(|| {
        Stop::new(format!("the study cannot be read on this machine:\n{}", complaints.trim_end()))
    })?;
    match study.libraries.absent.first() {
        Some(library) => Err(Stop::new(format!(
            "the library of plugins {} cannot be used on this machine",
            library.path.display()
        ))),
        None => Ok(study),
    }
}
