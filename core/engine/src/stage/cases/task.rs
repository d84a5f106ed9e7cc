//! The task of a process that computes cases: a file beside the orders.

use std::path::Path;

use lacuna::run::{Stop, files};
use lacuna::text::emit;
use lacuna_run::work;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::study::Study;

const FILE: &str = "task.json";

/// The need of a process that computes cases of a stage, besides the finished stages of the run directory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Hash of everything on which the cases depend, except for their numbers.
    pub inputs: String,
    /// The study with every default filled in.
    pub study: String,
    /// Options of the command, in addition to the study.
    pub asked: Value,
}

impl Task {
    /// The task of a study.
    pub fn of(study: &Study, inputs: &str, asked: &Value) -> Result<Self, Stop> {
        let text = emit::to_toml(&study.resolved)
            .map_err(|error| Stop::new(format!("cannot write the study of the cases: {error}")))?;
        Ok(Self { inputs: inputs.to_owned(), study: text, asked: asked.clone() })
    }

    /// Writes the task into the folder of a stage.
    pub fn write(&self, stage: &Path) -> Result<(), Stop> {
        files::write_json(&work::folder(stage).join(FILE), self)
    }

    /// Reads the task of a stage.
    pub fn read(stage: &Path) -> Result<Self, Stop> {
        files::read_json(&work::folder(stage).join(FILE))
    }
}
