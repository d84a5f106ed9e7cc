//! What is noted while runs are made: which were asked for, and how each ended.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Asked, RunRecord};
use crate::run::{Stop, files};
use crate::stage::simulator::Simulator;

const ROLL: &str = "asked.json";
const LOG: &str = "progress.jsonl";

/// The runs that were asked for: what tells a run that is missing from one that nobody wants.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Roll {
    /// The name of each scenario, empty in a study without, and its folder in that of the stage.
    pub scenarios: Vec<(String, PathBuf)>,
    /// The names of the runs.
    pub runs: Vec<String>,
}

impl Roll {
    pub(super) fn of(asked: Asked<'_>, simulator: &Simulator<'_>) -> Self {
        let scenario = |s: &super::Setting<'_>| (s.scenario.name.clone(), s.folder.clone());
        let scenarios = simulator.settings.iter().map(scenario).collect();
        Self { scenarios, runs: asked.names.to_vec() }
    }

    pub(super) fn write(&self, folder: &Path) -> Result<(), Stop> {
        files::write_json(&folder.join(ROLL), self)
    }

    /// The runs that a stage was asked for; `None` where the folder is none of a stage that makes runs.
    pub fn read(folder: &Path) -> Result<Option<Self>, Stop> {
        let path = folder.join(ROLL);
        if path.is_file() { files::read_json(&path).map(Some) } else { Ok(None) }
    }
}

/// The file to which each finished run is added.
pub(super) struct Log {
    path: PathBuf,
    file: File,
}

impl Log {
    pub(super) fn open(folder: &Path) -> Result<Self, Stop> {
        let path = folder.join(LOG);
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let file = file.map_err(|error| files::cannot_write(&path, &error))?;
        Ok(Self { path, file })
    }

    pub(super) fn note(&mut self, record: &RunRecord) -> Result<(), Stop> {
        let line = serde_json::to_string(record)
            .map_err(|e| Stop::new(format!("cannot note a finished run: {e}")))?;
        writeln!(self.file, "{line}").map_err(|error| files::cannot_write(&self.path, &error))
    }
}

/// What earlier attempts noted; the last word on each run counts.
pub fn earlier(folder: &Path) -> BTreeMap<String, RunRecord> {
    let text = fs::read_to_string(folder.join(LOG)).unwrap_or_default();
    text.lines()
        .filter_map(|line| serde_json::from_str::<RunRecord>(line).ok())
        .map(|record| (record.run.clone(), record))
        .collect()
}
