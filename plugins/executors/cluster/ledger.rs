//! Record of the submissions of a folder of runs.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};
use lacuna_run::work::{self, Order};
use serde::{Deserialize, Serialize};

use super::Cause;

/// Runs that were submitted to a scheduler together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Submission {
    /// Name of the executor that made the submission.
    pub executor: String,
    /// Number of the submission: the name of its folder in `campaign`.
    pub number: usize,
    /// Name under which the scheduler knows it.
    pub name: String,
    /// Path of the folder as given to the jobs; empty in a submission made by an older version.
    #[serde(default)]
    pub place: PathBuf,
    /// Job number given by the scheduler; `None` until it is known.
    pub job: Option<String>,
    /// Time of the submission, in seconds since 1970 (UTC).
    pub submitted: u64,
    /// Factor on the time limit.
    pub time: f64,
    /// Factor on the memory.
    pub memory: f64,
    /// Names of the runs of each task.
    pub tasks: Vec<Vec<String>>,
    /// Outcome of each run that has ended.
    pub settled: BTreeMap<String, Settled>,
}

/// Outcome of one run within a submission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Settled {
    /// The run left a marker.
    Marked,
    /// The run had not begun when its job ended.
    NotBegun,
    /// The run left no marker, for this cause, and is submitted again.
    Repeated(Cause),
    /// The run left no marker, for this cause, and was reported as failed.
    GivenUp(Cause),
}

/// Relation of the folder to the path that the jobs were given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whereabouts {
    /// The jobs have the right path.
    Same,
    /// The run directory has been moved to another path.
    Moved,
    /// The run directory is a copy; the jobs belong to the original.
    Copied,
}

const FILE: &str = "submission.json";
const WITHDRAWN: &str = "withdrawn";

impl Submission {
    /// Returns the folder of the submission.
    pub fn folder(&self, runs: &Path) -> PathBuf {
        folder(runs, self.number)
    }

    /// Writes the record to its folder.
    pub fn write(&self, runs: &Path) -> Result<(), Stop> {
        files::write_json(&self.folder(runs).join(FILE), self)
    }

    /// Iterates over the runs that have not ended, with the index of their task.
    pub fn open(&self) -> impl Iterator<Item = (usize, &String)> {
        let tasks = self.tasks.iter().enumerate();
        let runs = tasks.flat_map(|(task, runs)| runs.iter().map(move |run| (task, run)));
        runs.filter(|(_, run)| !self.settled.contains_key(*run))
    }

    /// Records that the jobs of the submission are being cancelled, so that the process that continues submits their
    /// runs again and counts none of them as failed.
    pub fn withdraw(&self, runs: &Path) -> Result<(), Stop> {
        files::write_atomic(&self.folder(runs).join(WITHDRAWN), b"")
    }

    /// Returns true if the jobs were being cancelled, by `lacuna campaign cancel` or because no run could have a
    /// result.
    pub fn is_withdrawn(&self, runs: &Path) -> bool {
        self.folder(runs).join(WITHDRAWN).exists()
    }

    /// Deletes the record, because the scheduler did not accept the submission.
    pub fn forget(&self, runs: &Path) -> Result<(), Stop> {
        let path = self.folder(runs).join(FILE);
        fs::remove_file(&path).map_err(|error| files::cannot_write(&path, &error))
    }

    /// Compares the path of the folder with that given to the jobs.
    pub fn whereabouts(&self, runs: &Path) -> Whereabouts {
        let here = self.folder(runs).canonicalize().unwrap_or_default();
        let there = self.place.canonicalize().unwrap_or_default();
        if self.place.as_os_str().is_empty() || here == there {
            return Whereabouts::Same;
        }
        match files::read_json::<Self>(&there.join(FILE)) {
            Ok(other) if other.name == self.name => Whereabouts::Copied,
            _ => Whereabouts::Moved,
        }
    }

    /// Marks open runs as not begun.
    pub fn close(&mut self, which: impl Fn(&str) -> bool) {
        let open = self.open().map(|(_, run)| run.clone());
        let runs: Vec<String> = open.filter(|run| which(run)).collect();
        self.settled.extend(runs.into_iter().map(|run| (run, Settled::NotBegun)));
    }

    /// Returns true if all runs have ended.
    pub fn is_over(&self) -> bool {
        self.open().next().is_none()
    }
}

/// Returns the folder of a submission.
pub fn folder(runs: &Path, number: usize) -> PathBuf {
    work::folder(runs).join(number.to_string())
}

/// Reads the submissions that one executor made for a folder of runs, oldest first, and returns the next free number.
pub fn read(runs: &Path, executor: &str) -> Result<(Vec<Submission>, usize), Stop> {
    let campaign = work::folder(runs);
    let mut numbers: Vec<usize> = fs::read_dir(&campaign)
        .map(|entries| {
            let name = |entry: fs::DirEntry| entry.file_name().to_str()?.parse().ok();
            entries.flatten().filter_map(name).collect()
        })
        .unwrap_or_default();
    numbers.sort_unstable();
    let free = numbers.last().map_or(1, |last| last + 1);
    let mut all = Vec::new();
    for number in numbers {
        let path = folder(runs, number).join(FILE);
        // A folder without the file was never submitted.
        if path.is_file() {
            all.push(files::read_json::<Submission>(&path)?);
        }
    }
    all.retain(|submission| submission.executor == executor);
    Ok((all, free))
}

/// Returns the number of resubmissions of a run for each cause, since it was last reported.
pub fn repeats(submissions: &[Submission], run: &str) -> BTreeMap<Cause, usize> {
    let mut counts = BTreeMap::new();
    for submission in submissions {
        match submission.settled.get(run) {
            Some(Settled::Repeated(cause)) => *counts.entry(*cause).or_insert(0) += 1,
            Some(Settled::GivenUp(_) | Settled::Marked) => counts.clear(),
            _ => {}
        }
    }
    counts
}

/// Returns the names of the runs of each task of an order.
pub fn tasks_of(order: &Order) -> Vec<Vec<String>> {
    let name = |i: &usize| order.jobs[*i].name.clone();
    order.tasks.iter().map(|task| task.iter().map(name).collect()).collect()
}
