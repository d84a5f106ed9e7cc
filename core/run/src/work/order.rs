//! Orders: runs requested from a process on another machine.

use std::path::{Path, PathBuf};

use lacuna::data::{Layout, Scenario, Unit};
use lacuna::plugin::Model;
use lacuna::plugin::executor::{Batch, Job, Recipe};
use lacuna::run::{Stop, files};
use serde::{Deserialize, Serialize};

/// A batch of jobs as a file, with the tasks into which they are grouped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// Version of Lacuna that wrote the order; another version could give different bits.
    pub lacuna: String,
    /// Description from which the model is built.
    pub model: Recipe,
    /// Names of the model's inputs.
    pub names: Vec<String>,
    /// Units of the model's inputs.
    pub units: Vec<Unit>,
    /// Layout of the requested response.
    pub layout: Layout,
    /// Conditions of all jobs.
    pub scenario: Scenario,
    /// Folder of the study file.
    pub study: PathBuf,
    /// Folder of the runs, relative to the folder of the order.
    pub runs: PathBuf,
    /// Jobs.
    pub jobs: Vec<Job>,
    /// Indices of the jobs of each task.
    pub tasks: Vec<Vec<usize>>,
}

const FILE: &str = "order.json";

impl Order {
    /// An order of jobs of a batch, grouped into tasks; `tasks` holds indices into `jobs`.
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
            // The order lies in `campaign/NUMBER`; a relative path lets a run directory be moved as a whole.
            runs: PathBuf::from("../.."),
            jobs,
            tasks,
        }
    }

    /// Writes the order into its folder.
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

    /// The order as a batch for the model that was built from it.
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
            // Problems are recorded in the markers and on standard error.
            warn: &|_| {},
        }
    }

    /// Hash of everything that is requested of each job: a marker of other inputs does not belong to this job.
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
