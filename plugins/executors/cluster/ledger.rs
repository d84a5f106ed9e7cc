//! The submissions of a folder of runs, as they are written down.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use lacuna::run::{Stop, files};
use lacuna::work::{self, Order};
use serde::{Deserialize, Serialize};

use super::Cause;

/// Runs that were handed to a scheduler together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Submission {
    /// The executor that made it.
    pub executor: String,
    /// Its number: the name of its folder in `campaign`.
    pub number: usize,
    /// The name by which it can be found in the scheduler.
    pub name: String,
    /// The folder as the jobs have it; empty in one that an older version made.
    #[serde(default)]
    pub place: PathBuf,
    /// The scheduler's number; `None` until it is known.
    pub job: Option<String>,
    /// When it was made, in seconds since 1970 (UTC).
    pub submitted: u64,
    /// The factor on the time limit.
    pub time: f64,
    /// The factor on the memory.
    pub memory: f64,
    /// The runs of each task.
    pub tasks: Vec<Vec<String>>,
    /// How its runs ended, as far as they have.
    pub settled: BTreeMap<String, Settled>,
}

/// How the part of a submission ended that was one run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Settled {
    /// It left a marker.
    Marked,
    /// It had not begun when its job ended.
    NotBegun,
    /// It left none, for this cause, and is submitted again.
    Repeated(Cause),
    /// It left none, for this cause, and was handed over as failed.
    GivenUp(Cause),
}

/// Whether jobs find the folder that they were given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whereabouts {
    /// They do.
    Same,
    /// The run directory has another path now.
    Moved,
    /// This is a copy; the jobs belong to the other one.
    Copied,
}

const FILE: &str = "submission.json";
const WITHDRAWN: &str = "withdrawn";

impl Submission {
    /// Its folder in that of the runs.
    pub fn folder(&self, runs: &Path) -> PathBuf {
        folder(runs, self.number)
    }

    /// Writes it down.
    pub fn write(&self, runs: &Path) -> Result<(), Stop> {
        files::write_json(&self.folder(runs).join(FILE), self)
    }

    /// The runs that have not ended, with their tasks.
    pub fn open(&self) -> impl Iterator<Item = (usize, &String)> {
        let tasks = self.tasks.iter().enumerate();
        let runs = tasks.flat_map(|(task, runs)| runs.iter().map(move |run| (task, run)));
        runs.filter(|(_, run)| !self.settled.contains_key(*run))
    }

    /// Notes that its jobs are being ended, so that whoever goes on submits its runs again and calls none of them failed.
    pub fn withdraw(&self, runs: &Path) -> Result<(), Stop> {
        files::write_atomic(&self.folder(runs).join(WITHDRAWN), b"")
    }

    /// Whether its jobs were being ended, by `lacuna campaign cancel` or because no run could have a result.
    pub fn is_withdrawn(&self, runs: &Path) -> bool {
        self.folder(runs).join(WITHDRAWN).exists()
    }

    /// Takes it back: the scheduler has nothing of it.
    pub fn forget(&self, runs: &Path) -> Result<(), Stop> {
        let path = self.folder(runs).join(FILE);
        fs::remove_file(&path).map_err(|error| files::cannot_write(&path, &error))
    }

    /// Where its folder is, seen from its jobs.
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

    /// Takes open runs out, without a word on how they ended.
    pub fn close(&mut self, which: impl Fn(&str) -> bool) {
        let open = self.open().map(|(_, run)| run.clone());
        let runs: Vec<String> = open.filter(|run| which(run)).collect();
        self.settled.extend(runs.into_iter().map(|run| (run, Settled::NotBegun)));
    }

    /// Whether all its runs have ended.
    pub fn is_over(&self) -> bool {
        self.open().next().is_none()
    }
}

/// The folder of a submission.
pub fn folder(runs: &Path, number: usize) -> PathBuf {
    work::folder(runs).join(number.to_string())
}

/// The submissions that one executor made for a folder of runs, oldest first; and the number that is free.
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
        // A folder without the file was never handed over.
        if path.is_file() {
            all.push(files::read_json::<Submission>(&path)?);
        }
    }
    all.retain(|submission| submission.executor == executor);
    Ok((all, free))
}

/// How often a run was submitted again for each cause since it was last handed over.
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

/// The order of a submission with the names of the runs of its tasks.
pub fn tasks_of(order: &Order) -> Vec<Vec<String>> {
    let name = |i: &usize| order.jobs[*i].name.clone();
    order.tasks.iter().map(|task| task.iter().map(name).collect()).collect()
}
