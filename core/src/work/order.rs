//! What a process on another machine is told.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::data::{Layout, Scenario, Unit};
use crate::plugin::Model;
use crate::plugin::executor::{Batch, Job, Recipe};
use crate::run::{Stop, files};

/// A batch of jobs as a file, with the tasks into which they are packed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// The version of Lacuna that wrote it; another could give other bits.
    pub lacuna: String,
    /// How the model is built.
    pub model: Recipe,
    /// The name of each input of the model.
    pub names: Vec<String>,
    /// The unit of each.
    pub units: Vec<Unit>,
    /// The shape of the response that is wanted.
    pub layout: Layout,
    /// The conditions of all jobs.
    pub scenario: Scenario,
    /// The folder of the study file.
    pub study: PathBuf,
    /// The folder of the runs, from the folder of the order.
    pub runs: PathBuf,
    /// The jobs.
    pub jobs: Vec<Job>,
    /// The numbers of the jobs of each task.
    pub tasks: Vec<Vec<usize>>,
}

const FILE: &str = "order.json";

impl Order {
    /// Some jobs of a batch, packed into tasks; `tasks` has numbers of `jobs`.
    pub fn new(batch: &Batch<'_>, jobs: Vec<Job>, tasks: Vec<Vec<usize>>) -> Self {
        let study = std::path::absolute(batch.study).unwrap_or_else(|_| batch.study.to_owned());
        Self {
            lacuna: env!("CARGO_PKG_VERSION").to_owned(),
            model: batch.recipe.clone(),
            names: batch.names.to_vec(),
            units: batch.units.to_vec(),
            layout: batch.layout.clone(),
            scenario: batch.scenario.clone(),
            study,
            // An order lies in `campaign/NUMBER`, so that a run directory may be moved as a whole.
            runs: PathBuf::from("../.."),
            jobs,
            tasks,
        }
    }

    /// Writes it into its folder.
    pub fn write(&self, folder: &Path) -> Result<(), Stop> {
        files::write_json(&folder.join(FILE), self)
    }

    /// Reads the order of a folder.
    pub fn read(folder: &Path) -> Result<Self, Stop> {
        let order: Self = files::read_json(&folder.join(FILE))?;
        let ours = env!("CARGO_PKG_VERSION");
        if order.lacuna != ours {
            let path = folder.join(FILE);
            return Err(Stop::new(format!(
                "{} was written by lacuna {}, this is lacuna {ours}",
                path.display(),
                order.lacuna
            ))
            .help("let `program` in `[executor]` name the version that runs the study"));
        }
        Ok(order)
    }

    /// The same as a batch for a model that was built.
    pub fn batch<'a>(&'a self, model: &'a dyn Model, directory: &'a Path) -> Batch<'a> {
        Batch {
            model,
            recipe: &self.model,
            names: &self.names,
            units: &self.units,
            jobs: &self.jobs,
            layout: &self.layout,
            scenario: &self.scenario,
            study: &self.study,
            directory,
            // What goes wrong is in the markers and on standard error.
            warn: &|_| {},
        }
    }

    /// A hash of all that is asked of each job: a marker of other inputs is not one of this job.
    pub fn fingerprints(&self) -> Result<Vec<String>, Stop> {
        let text = |value: Result<String, serde_json::Error>| {
            value.map_err(|error| Stop::new(format!("cannot hash an order: {error}")))
        };
        let common =
            (&self.lacuna, &self.model, &self.names, &self.units, &self.layout, &self.scenario);
        let common = text(serde_json::to_string(&common))?;
        let of = |job: &Job| {
            let own = text(serde_json::to_string(job))?;
            Ok(files::hash(format!("{common}\n{own}").as_bytes()))
        };
        self.jobs.iter().map(of).collect()
    }
}
