//! Reasons for which jobs wait, and causes of jobs that ended without results of their runs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Instant;

use lacuna::plugin::executor::Finished;
use lacuna::run::Stop;
use lacuna_run::work::Begun;

use super::{Campaign, Hand};
use crate::executors::cluster::ledger::{self, Settled, Submission};
use crate::executors::cluster::{Cause, States, TaskState, script};
use lacuna_run::process::tail_of_file;

/// Number of consecutive queries that a scheduler may leave unanswered.
const SILENCE: usize = 100;

/// A task that ended without a result of some of its runs.
struct Ended {
    runs: Vec<String>,
    /// True if the task made other runs.
    made_others: bool,
    cause: Cause,
    /// Number of the job and index of the task.
    job: String,
    /// Words of the scheduler, and the end of the printed output.
    words: String,
}

impl Campaign<'_> {
    /// Queries the scheduler and settles the tasks that ended without results of their runs.
    pub(super) fn judge(&mut self, finished: Hand<'_>) -> Result<(), Stop> {
        let Some(states) = self.states()? else { return Ok(()) };
        self.tell_reasons(&states);
        let is_known = |s: &&Submission| !s.is_over() && s.job.is_some();
        let open = self.submissions.iter().filter(is_known);
        let tasks: BTreeSet<(usize, usize)> =
            open.flat_map(|s| s.open().map(|(task, _)| (s.number, task))).collect();
        let patience = self.patience();
        let mut due = Vec::new();
        for key in tasks {
            if states.get(&key).is_some_and(TaskState::is_open) {
                self.ended.remove(&key);
            } else if self.ended.entry(key).or_insert_with(Instant::now).elapsed() >= patience {
                due.push(key);
            }
        }
        if due.is_empty() {
            return Ok(());
        }
        // Markers may have arrived during the query.
        self.collect(finished)?;
        due.into_iter().try_for_each(|key| self.sentence(key, states.get(&key), finished))
    }

    /// Returns the states of all open tasks; `None` if the scheduler does not answer or no task is open.
    fn states(&mut self) -> Result<Option<States>, Stop> {
        let asked = self.find_numbers().and_then(|()| {
            let open: Vec<&Submission> = self.submissions.iter().filter(|s| !s.is_over()).collect();
            if open.is_empty() { Ok(None) } else { self.scheduler.states(&open).map(Some) }
        });
        match asked {
            // A scheduler being restarted is neither a reason to give up nor one to submit anything again.
            Err(_) if self.silent < SILENCE => {
                self.silent += 1;
                Ok(None)
            }
            answered => {
                self.silent = 0;
                answered
            }
        }
    }

    /// Reports each new reason for which jobs wait beyond their turn in the queue.
    fn tell_reasons(&mut self, states: &States) {
        let mut waiting: BTreeMap<&String, usize> = BTreeMap::new();
        for state in states.values() {
            if let TaskState::Held(why) = state {
                *waiting.entry(why).or_insert(0) += 1;
            }
        }
        for (why, count) in waiting {
            let jobs = if count == 1 { "1 job waits" } else { &format!("{count} jobs wait") };
            self.tell(why, || format!("{jobs} for a reason other than the queue: {why}"));
        }
    }

    /// Settles the runs of a task that ended without a result of them.
    fn sentence(
        &mut self,
        (number, task): (usize, usize),
        state: Option<&TaskState>,
        finished: Hand<'_>,
    ) -> Result<(), Stop> {
        let Some(submission) = self.submissions.iter().find(|s| s.number == number) else {
            return Ok(());
        };
        let mut ended = Ended::of(submission, task, state, self.runs());
        let begun: Vec<String> =
            ended.runs.iter().filter(|run| self.was_begun(run, number)).cloned().collect();
        if ended.cause == Cause::Failure && begun.is_empty() && !ended.made_others {
            ended.cause = Cause::Start;
        }
        let charged: Vec<String> = if self.withdrawn.contains(&number)
            || ended.cause == Cause::Timeout && ended.made_others
        {
            // The runs are not at fault: the jobs were cancelled, or the time was spent on other runs of the pack.
            Vec::new()
        } else if begun.is_empty() || ended.cause.concerns_all() {
            ended.runs.clone()
        } else {
            begun
        };
        for run in &ended.runs {
            if charged.contains(run) {
                self.charge(run, &ended, finished)?;
            } else {
                self.settle(run, Settled::NotBegun)?;
            }
        }
        Ok(())
    }

    /// Submits a run again, or reports it as failed.
    fn charge(&mut self, run: &str, ended: &Ended, finished: Hand<'_>) -> Result<(), Stop> {
        let repeats = ledger::repeats(&self.submissions, run);
        let allowed = self.scheduler.rules().retry.after(ended.cause);
        let again = repeats.get(&ended.cause).copied().unwrap_or(0) < allowed;
        if ended.cause == Cause::Start && !(again && self.has_begun_any()) {
            let stop = Stop::new(ended.reason()).help(
                "`modules`, `setup` and `program` in `[executor]` are used before the first run: correct them and run the same \
                 command again; no run is counted as failed",
            );
            return Err(self.give_up(stop));
        }
        if again {
            return self.settle(run, Settled::Repeated(ended.cause));
        }
        if let Some(&index) = self.numbers.get(run)
            && !self.handed[index]
        {
            self.handed[index] = true;
            finished(Finished { index, outcome: Err(ended.reason()), seconds: 0.0 })?;
        }
        self.settle(run, Settled::GivenUp(ended.cause))
    }

    fn was_begun(&self, run: &str, number: usize) -> bool {
        self.begun(run).is_some_and(|begun| begun.order == number.to_string())
    }

    /// Returns true if any run has ever begun: then the jobs are set up correctly, and the fault lies with a node.
    fn has_begun_any(&self) -> bool {
        self.numbers.keys().any(|run| self.begun(run).is_some())
    }

    /// Returns the start record of a run, if it belongs to the same inputs.
    fn begun(&self, run: &str) -> Option<Begun> {
        let index = *self.numbers.get(run)?;
        Begun::read(self.runs(), run).filter(|begun| begun.asked == self.asked[index])
    }
}

impl Ended {
    fn of(submission: &Submission, task: usize, state: Option<&TaskState>, runs: &Path) -> Self {
        let folder = submission.folder(runs);
        let open = submission.open().filter(|(t, _)| *t == task);
        let open: Vec<String> = open.map(|(_, run)| run.clone()).collect();
        let (mut cause, words) = verdict(state, &folder, task);
        let job = submission.job.clone().unwrap_or_default();
        let said = tail_of_file(&folder.join(format!("task{task}.txt")));
        if cause == Cause::Failure && speaks_of_memory(&said) {
            cause = Cause::OutOfMemory;
        }
        let tail = if said.is_empty() { String::new() } else { format!(": {said}") };
        Self {
            made_others: submission.tasks[task].len() > open.len(),
            runs: open,
            cause,
            job: format!("job {job}, task {task}"),
            words: format!("({words}){tail}"),
        }
    }

    fn reason(&self) -> String {
        format!("{}: {} {}", self.job, self.cause, self.words)
    }
}

/// Returns true if the end of a job's output is Slurm's own message that it killed the job for its memory. If memory
/// is monitored but not limited, the state of such a job is that of any failure.
fn speaks_of_memory(said: &str) -> bool {
    said.lines().any(|line| {
        line.starts_with("slurmstepd")
            && (line.contains("exceeded memory limit") || line.contains("xceeded job memory limit"))
    })
}

/// Returns the cause for which a task left no result of a run, from the scheduler's state or the exit code that its
/// script wrote.
fn verdict(state: Option<&TaskState>, folder: &Path, task: usize) -> (Cause, String) {
    let code = script::exit_code(folder, task);
    match (state, code) {
        (Some(TaskState::Failed(Cause::Failure, words)), Some(code))
            if !words.contains("exit code") =>
        {
            (Cause::Failure, format!("{words}, exit code {code}"))
        }
        (Some(TaskState::Failed(cause, words)), _) => (*cause, words.clone()),
        (None, Some(code @ (137 | 143))) => {
            // A limit, a cancellation or a node shut down: only the scheduler knew which.
            (Cause::Lost, format!("and it was ended by signal {}", code - 128))
        }
        (_, Some(code)) => (Cause::Failure, format!("exit code {code}")),
        (Some(TaskState::Ended), None) => {
            (Cause::Failure, "it ended without a result or an exit code".to_owned())
        }
        _ => (Cause::Lost, "and it left no exit code".to_owned()),
    }
}
