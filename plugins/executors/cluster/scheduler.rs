//! What a scheduler is asked.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::run::Stop;

use super::script::{Frame, Worker};
use super::{Cause, Growth, Retry, Submission};

/// A scheduler that runs arrays of tasks.
pub trait Scheduler {
    /// What it is called in a study.
    fn name(&self) -> &'static str;

    /// How runs are packed, followed and repeated.
    fn rules(&self) -> Rules<'_>;

    /// How a task starts the program that makes its runs.
    fn worker(&self) -> Worker<'_>;

    /// The greatest number of tasks of one submission.
    fn most_tasks(&self) -> Result<usize, Stop>;

    /// What the script of a submission has that is the scheduler's own.
    fn frame(&self, plan: &Plan<'_>) -> Frame;

    /// Hands a submission over, whose script is this; returns the number by which the scheduler knows it. An error does
    /// not say that the scheduler has it not: the answer may have been lost.
    fn submit(&self, plan: &Plan<'_>, script: &Path) -> Result<String, Stop>;

    /// The number of a submission of this name, if the scheduler has one: after a process was killed between handing
    /// over and writing down.
    fn find(&self, name: &str) -> Result<Option<String>, Stop>;

    /// The state of the tasks of some submissions; what the scheduler does not know is left out.
    fn states(&self, submissions: &[&Submission]) -> Result<States, Stop>;

    /// Ends all tasks of the submissions with these numbers, of which some may have ended.
    fn cancel(&self, jobs: &[&str]) -> Result<(), Stop>;
}

/// How runs are packed, followed and repeated.
#[derive(Debug, Clone, Copy)]
pub struct Rules<'a> {
    /// Runs of a task.
    pub pack: usize,
    /// How often a run is submitted again.
    pub retry: &'a Retry,
    /// What it then gets more of.
    pub grow: &'a Growth,
    /// The longest pause between two questions to the scheduler, in seconds.
    pub poll: f64,
    /// How long files and accounts may lag behind the end of a job, in seconds.
    pub patience: f64,
}

/// A submission that is about to be made.
#[derive(Debug, Clone, Copy)]
pub struct Plan<'a> {
    /// Its folder, from the root.
    pub folder: &'a Path,
    /// The folder of the study.
    pub study: &'a Path,
    /// A name that no other submission has.
    pub name: &'a str,
    /// How many tasks it has.
    pub tasks: usize,
    /// The factor on the time limit.
    pub time: f64,
    /// The factor on the memory.
    pub memory: f64,
}

/// Where tasks are, by the submission's number in the ledger and the task.
pub type States = BTreeMap<(usize, usize), TaskState>;

/// Where a task is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TaskState {
    /// It waits for its turn; in the scheduler's words.
    Waiting(String),
    /// It waits for something that time alone may not bring: for this reason.
    Held(String),
    /// It runs, here.
    Running(String),
    /// It has ended as it should.
    Ended,
    /// It has ended for this cause; in the scheduler's words.
    Failed(Cause, String),
}

impl TaskState {
    /// Whether it may still make runs.
    pub fn is_open(&self) -> bool {
        matches!(self, Self::Waiting(_) | Self::Held(_) | Self::Running(_))
    }
}
