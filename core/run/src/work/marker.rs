//! Files that a run leaves behind: that it has begun, and how it ended.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use lacuna::plugin::executor::Written;
use lacuna::plugin::model::EvalError;
use lacuna::run::{Stop, files};
use serde::{Deserialize, Serialize};

use super::folder;

/// A run that a process has begun.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Begun {
    /// Hash of the request.
    pub asked: String,
    /// Name of the order's folder.
    pub order: String,
    /// Name of the machine.
    pub host: String,
    /// Process number on that machine.
    pub process: u32,
    /// Start time, in seconds since 1970 (UTC).
    pub since: u64,
}

impl Begun {
    fn path(runs: &Path, run: &str) -> PathBuf {
        folder(runs).join("begun").join(format!("{run}.json"))
    }

    /// Records that a run has begun.
    pub fn write(&self, runs: &Path, run: &str) -> Result<(), Stop> {
        files::write_json(&Self::path(runs, run), self)
    }

    /// Reads the record of a run; `None` if there is none.
    pub fn read(runs: &Path, run: &str) -> Option<Self> {
        files::read_json(&Self::path(runs, run)).ok()
    }
}

/// Marker of a run that has ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Hash of the request.
    pub asked: String,
    /// Outcome of the run.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// 0 if there is a response, otherwise 1.
    pub exit_code: i32,
    /// True if there is no response and the operating system killed processes for lack of memory during the run.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub out_of_memory: bool,
    /// Duration, in seconds.
    pub seconds: f64,
    /// Name of the machine.
    pub host: String,
    /// Time of completion, in seconds since 1970 (UTC).
    pub finished: u64,
}

/// Outcome of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "outcome")]
pub enum Outcome {
    /// A response was computed.
    Done {
        /// The response as written to a file.
        #[serde(flatten)]
        made: Written,
        /// SHA-256 of its file.
        sha256: String,
    },
    /// No response for these inputs.
    Failed {
        /// Reason given by the model.
        reason: String,
    },
    /// No response, for these or any other inputs.
    Hopeless {
        /// Reason given by the model.
        reason: String,
    },
}

impl Marker {
    /// The marker of a run that ended in this process.
    pub fn of(
        runs: &Path,
        asked: &str,
        outcome: Result<Written, EvalError>,
        seconds: f64,
        host: &str,
    ) -> Result<Self, Stop> {
        let outcome = match outcome {
            Ok(made) => {
                let sha256 = files::hash_file(&runs.join(&made.file))?;
                Outcome::Done { made, sha256 }
            }
            Err(EvalError::Rejected(reason)) => Outcome::Failed { reason },
            Err(EvalError::Fatal(reason)) => Outcome::Hopeless { reason },
        };
        Ok(Self {
            asked: asked.to_owned(),
            exit_code: i32::from(!matches!(outcome, Outcome::Done { .. })),
            outcome,
            out_of_memory: false,
            seconds,
            host: host.to_owned(),
            finished: super::now(),
        })
    }

    fn path(runs: &Path, run: &str) -> PathBuf {
        folder(runs).join("done").join(format!("{run}.json"))
    }

    /// Writes the marker of a run.
    pub fn write(&self, runs: &Path, run: &str) -> Result<(), Stop> {
        files::write_json(&Self::path(runs, run), self)
    }

    /// Reads the marker of a run with this request, if its result is present and unchanged.
    pub fn read(runs: &Path, run: &str, asked: &str) -> Option<Self> {
        let marker: Self = files::read_json(&Self::path(runs, run)).ok()?;
        let sound = match &marker.outcome {
            Outcome::Done { made, sha256 } => {
                files::hash_file(&runs.join(&made.file)).is_ok_and(|found| &found == sha256)
            }
            _ => true,
        };
        (sound && marker.asked == asked).then_some(marker)
    }

    /// Reads the marker of a run, whatever was requested.
    pub fn look(runs: &Path, run: &str) -> Option<Self> {
        files::read_json(&Self::path(runs, run)).ok()
    }

    /// Names of runs that have a marker. The folder is listed anew, which also makes a network file system notice names
    /// that did not exist before.
    pub fn names(runs: &Path) -> BTreeSet<String> {
        let entries = std::fs::read_dir(folder(runs).join("done"));
        let names = entries.into_iter().flatten().flatten().map(|entry| entry.file_name());
        names.filter_map(|name| Some(name.to_str()?.strip_suffix(".json")?.to_owned())).collect()
    }

    /// Removes the marker of a run that says that no run can succeed, once it has been reported: a repaired model is
    /// then called again.
    pub fn clear_hopeless(runs: &Path, run: &str) -> Result<(), Stop> {
        match Self::look(runs, run) {
            Some(Self { outcome: Outcome::Hopeless { .. }, .. }) => Self::set_aside(runs, run),
            _ => Ok(()),
        }
    }

    /// Removes the marker of a failed run, so that the run is repeated when it is requested again; the marker is kept
    /// as `campaign/failed/RUN-NUMBER.json`.
    pub fn set_aside(runs: &Path, run: &str) -> Result<(), Stop> {
        let failed = folder(runs).join("failed");
        let place = |n: u32| failed.join(format!("{run}-{n}.json"));
        let mut number = 1;
        while place(number).exists() {
            number += 1;
        }
        let target = place(number);
        let moved = std::fs::create_dir_all(&failed)
            .and_then(|()| std::fs::rename(Self::path(runs, run), &target));
        match moved {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(files::cannot_write(&target, &error))
            }
            _ => Ok(()),
        }
    }
}
