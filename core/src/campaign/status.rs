//! Where each run is.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::plugin::Executor;
use crate::plugin::executor::{Phase, Seen};
use crate::run::{Stop, files};
use crate::stage::simulate::{Roll, RunRecord, earlier};
use crate::work::{Begun, Marker, Outcome, now};

/// Where the runs of a run directory are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// The runs of all stages that make some.
    pub runs: Vec<Row>,
    /// What a reader must know first, such as a scheduler that does not answer.
    pub warnings: Vec<String>,
}

/// One run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The folder of its stage.
    pub stage: String,
    /// The scenario; empty in a study without.
    pub scenario: String,
    /// Its name.
    pub run: String,
    /// Where it is.
    pub state: State,
    /// Why, or where, in words.
    pub note: String,
    /// How long it took, in seconds, once it is done.
    pub seconds: Option<f64>,
}

/// Where a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// It has a result.
    Done,
    /// It runs.
    Running,
    /// It waits in a queue.
    Waiting,
    /// It ended without a result.
    Failed,
    /// Nobody makes it now.
    Missing,
}

impl State {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 5] =
        [Self::Done, Self::Running, Self::Waiting, Self::Failed, Self::Missing];

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Running => "running",
            Self::Waiting => "waiting",
            Self::Failed => "failed",
            Self::Missing => "missing",
        }
    }
}

/// Looks at a run directory; `busy` says whether a process works in it.
pub fn status(root: &Path, executor: Option<&dyn Executor>, busy: bool) -> Result<Status, Stop> {
    let mut status = Status { runs: Vec::new(), warnings: Vec::new() };
    for (stage, folder, roll) in stages(root)? {
        for (scenario, own) in &roll.scenarios {
            let folder = if own.as_os_str().is_empty() { folder.clone() } else { folder.join(own) };
            let seen = executor.map_or(Ok(Vec::new()), |executor| executor.look(&folder));
            let seen = seen.unwrap_or_else(|stop| {
                status.warnings.push(stop.message);
                Vec::new()
            });
            let place = Place {
                logged: earlier(&folder),
                seen: seen.into_iter().map(|seen| (seen.run.clone(), seen)).collect(),
                folder,
                busy,
            };
            for run in &roll.runs {
                let (state, note, seconds) = place.of(run);
                let (stage, scenario, run) = (stage.clone(), scenario.clone(), run.clone());
                status.runs.push(Row { stage, scenario, run, state, note, seconds });
            }
        }
    }
    status.warnings.dedup();
    Ok(status)
}

/// Ends what runs or waits somewhere else; returns how many runs that stops.
pub fn cancel(root: &Path, executor: &dyn Executor) -> Result<usize, Stop> {
    let mut stopped = 0;
    for (_, folder, roll) in stages(root)? {
        for (_, own) in &roll.scenarios {
            stopped += executor.cancel(&folder.join(own))?;
        }
    }
    Ok(stopped)
}

/// The stages that make runs, by name.
fn stages(root: &Path) -> Result<Vec<(String, PathBuf, Roll)>, Stop> {
    let entries = fs::read_dir(root).map_err(|error| files::cannot_read(root, &error))?;
    let mut found = Vec::new();
    for entry in entries.flatten() {
        if let Some(roll) = Roll::read(&entry.path())? {
            found.push((entry.file_name().to_string_lossy().into_owned(), entry.path(), roll));
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(found)
}

/// The folder of one scenario's runs.
struct Place {
    folder: PathBuf,
    logged: BTreeMap<String, RunRecord>,
    seen: BTreeMap<String, Seen>,
    busy: bool,
}

impl Place {
    fn of(&self, run: &str) -> (State, String, Option<f64>) {
        let record = self.logged.get(run);
        if let Some(RunRecord { file: Some(_), seconds, .. }) = record {
            return (State::Done, String::new(), Some(*seconds));
        }
        if let Some(marker) = Marker::look(&self.folder, run) {
            return match marker.outcome {
                Outcome::Done { .. } => {
                    let note = format!("not collected yet, made on {}", marker.host);
                    (State::Done, note, Some(marker.seconds))
                }
                Outcome::Failed { reason } | Outcome::Hopeless { reason } => {
                    (State::Failed, reason, Some(marker.seconds))
                }
            };
        }
        let begun = Begun::read(&self.folder, run);
        let since = begun.as_ref().map(|begun| {
            let minutes = now().saturating_sub(begun.since) / 60;
            format!("begun {minutes} min ago on {}", begun.host)
        });
        if let Some(seen) = self.seen.get(run) {
            return match (seen.phase, since, self.busy) {
                (Phase::Runs, Some(since), _) => {
                    (State::Running, format!("{since}, {}", seen.note), None)
                }
                (Phase::Ended, _, false) => (State::Missing, seen.note.clone(), None),
                // Its job makes another run of the pack, or whoever waits for it will soon see that it has ended.
                _ => (State::Waiting, seen.note.clone(), None),
            };
        }
        let failure = record.and_then(|record| record.reason.clone());
        match (failure, since, self.busy) {
            (Some(reason), _, _) => (State::Failed, reason, None),
            (None, Some(since), true) => (State::Running, since, None),
            (None, Some(since), false) => (State::Missing, format!("interrupted: {since}"), None),
            (None, None, true) => (State::Waiting, "for its turn".to_owned(), None),
            (None, None, false) => (State::Missing, "not submitted".to_owned(), None),
        }
    }
}
