//! Why jobs wait, and why they have ended without a word of their runs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Instant;

use lacuna::plugin::executor::Finished;
use lacuna::run::Stop;
use lacuna::work::Begun;

use super::{Campaign, Hand};
use crate::executors::cluster::ledger::{self, Settled, Submission};
use crate::executors::cluster::{Cause, States, TaskState, script};
use crate::models::process::tail_of_file;

/// How many answers in a row a scheduler may owe.
const SILENCE: usize = 100;

/// A task that has ended and left no word of some of its runs.
struct Ended {
    runs: Vec<String>,
    /// Whether the task made other runs.
    made_others: bool,
    cause: Cause,
    /// The job and its task.
    job: String,
    /// The scheduler's words, and what was printed last.
    words: String,
}

impl Campaign<'_> {
    /// Asks the scheduler and judges the tasks that have ended without a word of their runs.
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
        // Markers that arrived while the scheduler was asked.
        self.collect(finished)?;
        due.into_iter().try_for_each(|key| self.sentence(key, states.get(&key), finished))
    }

    /// What the scheduler says of all that is open; `None` when it does not answer, or nothing is.
    fn states(&mut self) -> Result<Option<States>, Stop> {
        let asked = self.find_numbers().and_then(|()| {
            let open: Vec<&Submission> = self.submissions.iter().filter(|s| !s.is_over()).collect();
            if open.is_empty() { Ok(None) } else { self.scheduler.states(&open).map(Some) }
        });
        match asked {
            // A scheduler that is being restarted is no reason to give up; nor is it one to submit anything again.
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

    /// Tells each new reason for which jobs wait for more than their turn.
    fn tell_reasons(&mut self, states: &States) {
        let mut waiting: BTreeMap<&String, usize> = BTreeMap::new();
        for state in states.values() {
            if let TaskState::Held(why) = state {
                *waiting.entry(why).or_insert(0) += 1;
            }
        }
        for (why, count) in waiting {
            let jobs = if count == 1 { "1 job waits" } else { &format!("{count} jobs wait") };
            self.tell(why, || format!("{jobs} for more than a turn: {why}"));
        }
    }

    /// Settles the runs of a task that has ended and left no word of them.
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
            // The runs are not at fault: somebody ended the jobs, or the time went to other runs of the pack.
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

    /// Has a run submitted again, or hands it over as failed.
    fn charge(&mut self, run: &str, ended: &Ended, finished: Hand<'_>) -> Result<(), Stop> {
        let repeats = ledger::repeats(&self.submissions, run);
        let allowed = self.scheduler.rules().retry.after(ended.cause);
        let again = repeats.get(&ended.cause).copied().unwrap_or(0) < allowed;
        if ended.cause == Cause::Start && !(again && self.has_begun_any()) {
            let stop = Stop::new(ended.reason()).help(
                "`modules`, `setup` and `program` in `[executor]` come before the first run: mend them and run the same \
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

    /// Whether any run was ever begun: then the jobs are sound, and it is a node that is not.
    fn has_begun_any(&self) -> bool {
        self.numbers.keys().any(|run| self.begun(run).is_some())
    }

    /// What is noted of a run for which the same was asked.
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

/// Whether the end of what a job printed is Slurm's own word that it killed it for its memory: where that is watched and not
/// limited, the state of the job is that of any failure.
fn speaks_of_memory(said: &str) -> bool {
    said.lines().any(|line| {
        line.starts_with("slurmstepd")
            && (line.contains("exceeded memory limit") || line.contains("xceeded job memory limit"))
    })
}

/// Why a task left no word of a run: the scheduler's word, or the exit code that its script wrote.
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
            // A limit, somebody who cancelled it, a node that was shut down: only the scheduler knew.
            (Cause::Lost, format!("and it was ended by signal {}", code - 128))
        }
        (_, Some(code)) => (Cause::Failure, format!("exit code {code}")),
        (Some(TaskState::Ended), None) => {
            (Cause::Failure, "it ended without a word of the run".to_owned())
        }
        _ => (Cause::Lost, "and it left no exit code".to_owned()),
    }
}
