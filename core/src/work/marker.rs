//! What a run leaves behind: that it was begun, and how it ended.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::folder;
use crate::plugin::executor::Written;
use crate::plugin::model::EvalError;
use crate::run::{Stop, files};

/// A run that a process has begun.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Begun {
    /// The hash of what was asked.
    pub asked: String,
    /// The order: the name of its folder.
    pub order: String,
    /// The machine.
    pub host: String,
    /// The number of the process there.
    pub process: u32,
    /// When, in seconds since 1970 (UTC).
    pub since: u64,
}

impl Begun {
    fn path(runs: &Path, run: &str) -> PathBuf {
        folder(runs).join("begun").join(format!("{run}.json"))
    }

    /// Notes that a run has begun.
    pub fn write(&self, runs: &Path, run: &str) -> Result<(), Stop> {
        files::write_json(&Self::path(runs, run), self)
    }

    /// What is noted of a run.
    pub fn read(runs: &Path, run: &str) -> Option<Self> {
        files::read_json(&Self::path(runs, run)).ok()
    }
}

/// A run that has ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// The hash of what was asked.
    pub asked: String,
    /// How it ended.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// 0 where there is a response, else 1.
    pub exit_code: i32,
    /// Whether the system killed processes for want of memory while it was made, and it has no response.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub out_of_memory: bool,
    /// How long it took, in seconds.
    pub seconds: f64,
    /// The machine.
    pub host: String,
    /// When, in seconds since 1970 (UTC).
    pub finished: u64,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "outcome")]
pub enum Outcome {
    /// With a response.
    Done {
        /// The response as it was written down.
        #[serde(flatten)]
        made: Written,
        /// The SHA-256 of its file.
        sha256: String,
    },
    /// Without one, for these inputs.
    Failed {
        /// Why, in the model's words.
        reason: String,
    },
    /// Without one, and so will all others.
    Hopeless {
        /// Why, in the model's words.
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

    /// The marker of a run for which this was asked, if its result is there as it was written.
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

    /// The marker of a run, whatever was asked.
    pub fn look(runs: &Path, run: &str) -> Option<Self> {
        files::read_json(&Self::path(runs, run)).ok()
    }

    /// The runs that have a marker. The folder is listed anew, which also tells a file system that is seen from several
    /// machines to look again for names that were not there.
    pub fn names(runs: &Path) -> BTreeSet<String> {
        let entries = std::fs::read_dir(folder(runs).join("done"));
        let names = entries.into_iter().flatten().flatten().map(|entry| entry.file_name());
        names.filter_map(|name| Some(name.to_str()?.strip_suffix(".json")?.to_owned())).collect()
    }

    /// Takes the marker of a run away that says that no run can have a result, once it is known: a model that was mended
    /// is asked again.
    pub fn clear_hopeless(runs: &Path, run: &str) -> Result<(), Stop> {
        match Self::look(runs, run) {
            Some(Self { outcome: Outcome::Hopeless { .. }, .. }) => Self::set_aside(runs, run),
            _ => Ok(()),
        }
    }

    /// Takes the marker of a failure away, so that the run is made anew when it is asked for again; it is kept as
    /// `campaign/failed/RUN-NUMBER.json`.
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
