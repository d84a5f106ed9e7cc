//! Continuation of what an earlier process left behind.

use std::time::Instant;

use lacuna::run::{Stop, files};
use lacuna_run::work::{self, Order};

use super::Campaign;
use crate::executors::cluster::ledger::{Submission, Whereabouts};
use crate::executors::cluster::{Cause, TaskState, look};

/// Age in seconds above which a submission is no longer on its way to the scheduler.
const OLD: u64 = 600;

impl Campaign<'_> {
    /// Takes over from an earlier process: finds the job numbers that it could not record, and closes what has been
    /// cancelled since, which is then submitted again.
    pub(super) fn adopt(&mut self) -> Result<(), Stop> {
        for submission in self.submissions.iter_mut().filter(|s| !s.is_over()) {
            // Runs that this batch does not ask for have been reported already.
            submission.close(|run| !self.numbers.contains_key(run));
            if submission.is_withdrawn(self.batch.directory) {
                self.withdrawn.insert(submission.number);
            }
            submission.write(self.batch.directory)?;
        }
        let kept = |run: &str| {
            let holds = |s: &&Submission| s.open().any(|(_, open)| open == run);
            let submission = self.submissions.iter().find(holds);
            submission.is_some_and(|s| !self.withdrawn.contains(&s.number))
        };
        self.clear_hopeless(|run| !kept(run))?;
        self.find_numbers()?;
        self.leave_what_is_elsewhere()?;
        self.close_cancelled()
    }

    /// Queries the numbers of submissions that have none. A submission unknown to the scheduler is closed once it can
    /// no longer be on its way.
    pub(super) fn find_numbers(&mut self) -> Result<(), Stop> {
        let (runs, patience) = (self.runs(), self.patience());
        for submission in self.submissions.iter_mut().filter(|s| !s.is_over() && s.job.is_none()) {
            submission.job = self.scheduler.find(&submission.name)?;
            if submission.job.is_none() {
                let first = *self.unheard.entry(submission.number).or_insert_with(Instant::now);
                let is_old = work::now().saturating_sub(submission.submitted) > OLD;
                if !is_old && first.elapsed() < patience {
                    continue;
                }
                if !left_traces(submission, runs) {
                    submission.close(|_| true);
                }
            }
            submission.write(runs)?;
        }
        Ok(())
    }

    /// Cancels the jobs of a run directory that was moved, since they use the old path, and leaves alone those of a
    /// directory from which this one was copied.
    fn leave_what_is_elsewhere(&mut self) -> Result<(), Stop> {
        let runs = self.runs();
        let (scheduler, warn) = (self.scheduler, self.batch.warn);
        for submission in self.submissions.iter_mut().filter(|s| !s.is_over()) {
            let place = submission.place.display().to_string();
            match submission.whereabouts(runs) {
                Whereabouts::Same => continue,
                Whereabouts::Moved => {
                    warn(&format!(
                        "the run directory was moved: the jobs that use {place} are cancelled and submitted again"
                    ));
                    look::end(scheduler, &[&*submission], runs)?;
                }
                Whereabouts::Copied => warn(&format!(
                    "this run directory is a copy: the jobs of {place} continue, and their runs are submitted again from here"
                )),
            }
            submission.close(|_| true);
            submission.write(runs)?;
        }
        Ok(())
    }

    fn close_cancelled(&mut self) -> Result<(), Stop> {
        let open: Vec<&Submission> = self.submissions.iter().filter(|s| !s.is_over()).collect();
        if open.is_empty() {
            return Ok(());
        }
        let states = self.scheduler.states(&open)?;
        for submission in self.submissions.iter_mut().filter(|s| !s.is_over()) {
            let is_withdrawn = self.withdrawn.contains(&submission.number);
            let is_cancelled = |task: usize| match states.get(&(submission.number, task)) {
                Some(TaskState::Failed(Cause::Cancelled, _)) => true,
                // Cancelled jobs may need a moment to end.
                state => is_withdrawn && !state.is_some_and(TaskState::is_open),
            };
            let gone: Vec<String> = submission
                .open()
                .filter(|(task, _)| is_cancelled(*task))
                .map(|(_, run)| run.clone())
                .collect();
            submission.close(|run| gone.iter().any(|gone| gone == run));
            submission.write(self.batch.directory)?;
        }
        Ok(())
    }
}

/// Returns true if a task of a submission has ever run.
fn left_traces(submission: &Submission, runs: &std::path::Path) -> bool {
    let folder = submission.folder(runs);
    (0..submission.tasks.len()).any(|task| folder.join(format!("task{task}.txt")).exists())
        || files::read_json::<Order>(&folder.join("order.json")).is_err()
}
