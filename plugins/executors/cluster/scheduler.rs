//! Interface to a scheduler.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use lacuna::run::Stop;

use super::script::{Frame, Worker};
use super::{Cause, Growth, Retry, Submission};

/// A scheduler that runs arrays of tasks.
pub trait Scheduler {
    /// Returns its name in a study.
    fn name(&self) -> &'static str;

    /// Returns the rules for grouping, polling and resubmission.
    fn rules(&self) -> Rules<'_>;

    /// Returns the settings of the program that makes the runs of a task.
    fn worker(&self) -> Worker<'_>;

    /// Returns the maximum number of tasks of one submission.
    fn most_tasks(&self) -> Result<usize, Stop>;

    /// Returns the scheduler's own part of the script of a submission.
    fn frame(&self, plan: &Plan<'_>) -> Frame;

    /// Submits the script and returns the job number. After an error the scheduler may still have accepted it: the
    /// answer may have been lost.
    fn submit(&self, plan: &Plan<'_>, script: &Path) -> Result<String, Stop>;

    /// Returns the number of the submission of this name, if the scheduler has one. Needed after a process was killed
    /// between submitting and recording.
    fn find(&self, name: &str) -> Result<Option<String>, Stop>;

    /// Returns the state of the tasks of some submissions, without those unknown to the scheduler.
    fn states(&self, submissions: &[&Submission]) -> Result<States, Stop>;

    /// Cancels all tasks of the submissions with these numbers; some may have ended.
    fn cancel(&self, jobs: &[&str]) -> Result<(), Stop>;
}

/// Rules for grouping, polling and resubmission.
#[derive(Debug, Clone, Copy)]
pub struct Rules<'a> {
    /// Number of runs per task.
    pub pack: usize,
    /// Number of resubmissions by cause.
    pub retry: &'a Retry,
    /// Increase of the limits at resubmission.
    pub grow: &'a Growth,
    /// Longest interval between two queries to the scheduler.
    pub poll: Duration,
    /// Time by which files and accounting may lag behind the end of a job.
    pub patience: Duration,
}

/// A submission about to be made.
#[derive(Debug, Clone, Copy)]
pub struct Plan<'a> {
    /// Absolute path of its folder.
    pub folder: &'a Path,
    /// Folder of the study.
    pub study: &'a Path,
    /// Unique name.
    pub name: &'a str,
    /// Number of tasks.
    pub tasks: usize,
    /// Factor on the time limit.
    pub time: f64,
    /// Factor on the memory.
    pub memory: f64,
}

/// States of tasks, by the number of the submission in the ledger and the index of the task.
pub type States = BTreeMap<(usize, usize), TaskState>;

/// State of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TaskState {
    /// Waits for its turn, with the scheduler's words.
    Waiting(String),
    /// Waits for a reason that time alone may not remove.
    Held(String),
    /// Runs on this node.
    Running(String),
    /// Ended normally.
    Ended,
    /// Ended for this cause, with the scheduler's words.
    Failed(Cause, String),
}

impl TaskState {
    /// Returns true if the task may still make runs.
    pub fn is_open(&self) -> bool {
        matches!(self, Self::Waiting(_) | Self::Held(_) | Self::Running(_))
    }
}
