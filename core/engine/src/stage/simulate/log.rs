//! Records kept while runs are made: which were requested, and how each ended.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use lacuna::plugin::Executor;
use lacuna::plugin::registry::{self, Built};
use lacuna::run::{Stop, files};
use lacuna::text::emit;
use serde::{Deserialize, Serialize};

use super::{Asked, RunRecord};
use crate::stage::simulator::Simulator;

const ROLL: &str = "asked.json";
const LOG: &str = "progress.jsonl";

/// The requested runs, which distinguish a missing run from one that was not requested.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Roll {
    /// Name of each scenario (empty in a study without scenarios), and its folder inside that of the stage.
    pub scenarios: Vec<(String, PathBuf)>,
    /// Names of the runs.
    pub runs: Vec<String>,
    /// Executor of the runs, if it is not that of the study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub executor: Option<Own>,
}

/// An executor as it was chosen.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Own {
    /// Name of its plugin.
    #[serde(rename = "use")]
    pub name: String,
    /// All options as TOML.
    pub options: String,
}

impl Own {
    /// Builds the executor.
    pub fn build(&self) -> Result<Box<dyn Executor>, Stop> {
        let built = registry::from_text::<dyn Executor>(&self.name, &self.options);
        built.map(|built| built.plugin).map_err(|complaints| {
            Stop::new(format!("the executor `{}` cannot be built:\n{complaints}", self.name))
        })
    }
}

impl Roll {
    pub(super) fn of(asked: Asked<'_>, simulator: &Simulator<'_>) -> Self {
        let scenario = |s: &super::Setting<'_>| (s.scenario.name.clone(), s.folder.clone());
        let scenarios = simulator.settings.iter().map(scenario).collect();
        Self { scenarios, runs: asked.names.to_vec(), executor: None }
    }

    /// Cases of a stage, which this executor computes.
    pub fn of_cases(runs: Vec<String>, executor: &Built<dyn Executor>) -> Result<Self, Stop> {
        let options = emit::to_toml(&executor.options).map_err(|error| {
            Stop::new(format!("cannot write the options of `{}`: {error}", executor.name))
        })?;
        let executor = Some(Own { name: executor.name.to_owned(), options });
        Ok(Self { scenarios: vec![(String::new(), PathBuf::new())], runs, executor })
    }

    /// Writes the list into the folder of a stage.
    pub fn write(&self, folder: &Path) -> Result<(), Stop> {
        files::write_json(&folder.join(ROLL), self)
    }

    /// Reads the requested runs of a stage; `None` if the folder does not belong to a stage that makes runs.
    pub fn read(folder: &Path) -> Result<Option<Self>, Stop> {
        let path = folder.join(ROLL);
        if path.is_file() { files::read_json(&path).map(Some) } else { Ok(None) }
    }
}

/// File to which each finished run is appended.
pub struct Log {
    path: PathBuf,
    file: File,
}

impl Log {
    /// Opens the file in the folder of the runs.
    pub fn open(folder: &Path) -> Result<Self, Stop> {
        let path = folder.join(LOG);
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let mut file = file.map_err(|error| files::cannot_write(&path, &error))?;
        // A process killed while writing leaves an incomplete line, which must not corrupt the next one.
        if !fs::read(&path).is_ok_and(|bytes| bytes.is_empty() || bytes.ends_with(b"\n")) {
            writeln!(file).map_err(|error| files::cannot_write(&path, &error))?;
        }
        Ok(Self { path, file })
    }

    /// Appends the record of a finished run.
    pub fn note(&mut self, record: &RunRecord) -> Result<(), Stop> {
        let line = serde_json::to_string(record)
            .map_err(|e| Stop::new(format!("cannot note a finished run: {e}")))?;
        writeln!(self.file, "{line}").map_err(|error| files::cannot_write(&self.path, &error))
    }
}

/// Records of earlier attempts; the last one of each run is valid.
pub fn earlier(folder: &Path) -> BTreeMap<String, RunRecord> {
    let text = fs::read(folder.join(LOG)).unwrap_or_default();
    text.split(|byte| *byte == b'\n')
        .filter_map(|line| serde_json::from_slice::<RunRecord>(line).ok())
        .map(|record| (record.run.clone(), record))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_line_costs_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let record = |run: &str| RunRecord {
            run: run.to_owned(),
            file: None,
            sha256: None,
            valid: false,
            reason: Some("größer".to_owned()),
            seconds: 1.0,
        };
        Log::open(folder.path()).unwrap().note(&record("run001")).unwrap();
        let path = folder.path().join(LOG);
        let whole = fs::read(&path).unwrap();
        // Cut inside a two-byte character.
        let cut = whole.iter().position(|byte| *byte > 127).unwrap() + 1;
        fs::write(&path, [&whole[..], &whole[..cut]].concat()).unwrap();
        Log::open(folder.path()).unwrap().note(&record("run002")).unwrap();
        let names: Vec<String> = earlier(folder.path()).into_keys().collect();
        assert_eq!(names, ["run001", "run002"]);
    }
}
