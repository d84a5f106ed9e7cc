//! Status of each run.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use lacuna::plugin::Executor;
use lacuna::plugin::executor::{Phase, Seen};
use lacuna::run::{Stop, files};
use lacuna_run::Stage;
use lacuna_run::work::{Begun, Marker, Outcome, now};
use serde::Serialize;

use crate::stage::design;
use crate::stage::simulate::{Roll, RunRecord, earlier};
use crate::study::Study;

/// Status of the runs of a run directory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// Runs of all stages that make runs.
    pub runs: Vec<Row>,
    /// Warnings to show first, such as a scheduler that does not respond.
    pub warnings: Vec<String>,
}

/// Status of one run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Folder of its stage.
    pub stage: String,
    /// Name of the scenario; empty in a study without scenarios.
    pub scenario: String,
    /// Name of the run.
    pub run: String,
    /// State of the run.
    pub state: State,
    /// Reason or location, as text.
    pub note: String,
    /// Duration, in seconds, once it is done.
    pub seconds: Option<f64>,
}

/// State of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Ended with a result.
    Done,
    /// Running.
    Running,
    /// Waiting in a queue.
    Waiting,
    /// Ended without a result.
    Failed,
    /// Not being made at present.
    Missing,
}

impl State {
    /// All states, in the order in which they are shown.
    pub const ALL: [Self; 5] =
        [Self::Done, Self::Running, Self::Waiting, Self::Failed, Self::Missing];

    /// Name of the state.
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

/// Status of a run directory; `busy` is true if a process works in it. A directory in which no study was run, only cases of
/// one were counted, has none.
pub fn status(study: Option<&Study>, root: &Path, busy: bool) -> Result<Status, Stop> {
    let look = |roll: &Roll, folder: &Path| {
        with_executor(roll, study, |executor| executor.look(folder))
            .unwrap_or_else(|| Ok(Vec::new()))
    };
    let names = || study.map_or(Ok((Vec::new(), 0)), |study| design::run_names(study.trained()));
    gathered(root, &look, &names, busy)
}

/// Calls the executor of the runs of a stage: its own, or that of the study; `None` if there is none.
fn with_executor<T>(
    roll: &Roll,
    study: Option<&Study>,
    act: impl FnOnce(&dyn Executor) -> Result<T, Stop>,
) -> Option<Result<T, Stop>> {
    match &roll.executor {
        Some(own) => Some(own.build().and_then(|executor| act(&*executor))),
        None => study?.executor.as_ref().map(|section| act(&*section.built.plugin)),
    }
}

/// Like [`status`], from the files of the run directory alone: no scheduler is asked, and runs that were added to the design
/// appear when they are requested.
pub fn status_on_disk(root: &Path, busy: bool) -> Result<Status, Stop> {
    gathered(root, &|_, _| Ok(Vec::new()), &|| Ok((Vec::new(), 0)), busy)
}

/// Finds the jobs of the runs in a folder that run or are queued elsewhere.
type Look<'a> = dyn Fn(&Roll, &Path) -> Result<Vec<Seen>, Stop> + 'a;

/// Status of a run directory; `names` returns the names of all runs of the design, and where the imported ones begin.
fn gathered(
    root: &Path,
    look: &Look<'_>,
    names: &dyn Fn() -> Result<(Vec<String>, usize), Stop>,
    busy: bool,
) -> Result<Status, Stop> {
    let mut status = Status { runs: Vec::new(), warnings: Vec::new() };
    for (stage, folder, roll) in stages(root)? {
        let of_design = stage == Stage::Simulate.folder().name();
        let (all, made) = if of_design { names()? } else { (Vec::new(), 0) };
        let listed: HashSet<&String> = roll.runs.iter().collect();
        let added: Vec<(usize, &String)> =
            all.iter().enumerate().filter(|(_, name)| !listed.contains(name)).collect();
        for (scenario, own) in &roll.scenarios {
            let folder = if own.as_os_str().is_empty() { folder.clone() } else { folder.join(own) };
            let seen = look(&roll, &folder).unwrap_or_else(|stop| {
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
            status.runs.extend(added.iter().map(|&(i, run)| {
                let (state, note) = if i < made {
                    (State::Missing, "added to the design, not begun")
                } else {
                    (State::Done, "imported")
                };
                let (stage, scenario) = (stage.clone(), scenario.clone());
                Row {
                    stage,
                    scenario,
                    run: run.clone(),
                    state,
                    note: note.to_owned(),
                    seconds: None,
                }
            }));
        }
    }
    status.warnings.dedup();
    Ok(status)
}

/// Cancels jobs that run or are queued elsewhere; returns the number of runs that this stops.
pub fn cancel(study: Option<&Study>, root: &Path) -> Result<usize, Stop> {
    let mut stopped = 0;
    for (_, folder, roll) in stages(root)? {
        for (_, own) in &roll.scenarios {
            let folder = folder.join(own);
            let ended = with_executor(&roll, study, |executor| executor.cancel(&folder));
            stopped += ended.unwrap_or(Ok(0))?;
        }
    }
    Ok(stopped)
}

/// Returns true if the run directory has stages that make runs.
pub fn has_runs(root: &Path) -> bool {
    stages(root).is_ok_and(|stages| !stages.is_empty())
}

/// Stages that make runs, by name.
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

/// Folder of one scenario's runs.
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
                // Its job is making another run of the pack, or the waiting process will soon notice that it has ended.
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
