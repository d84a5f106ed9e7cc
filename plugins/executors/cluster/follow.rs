//! From a batch to its results, through a scheduler.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use lacuna::plugin::executor::{Batch, Finished};
use lacuna::run::{Stop, files};
use lacuna::work::{Begun, Marker, Order, Outcome};

use super::ledger::{self, Settled, Submission};
use super::{Cause, Scheduler, TaskState, pack, script};
use crate::models::process::tail_of_file;

type Hand<'h> = &'h mut dyn FnMut(Finished) -> Result<(), Stop>;

/// Has the jobs of a batch run and hands each over as it ends. What was submitted before is not submitted again.
pub fn follow(
    scheduler: &dyn Scheduler,
    batch: &Batch<'_>,
    finished: Hand<'_>,
) -> Result<(), Stop> {
    if batch.jobs.is_empty() {
        return Ok(());
    }
    let asked = Order::new(batch, batch.jobs.to_vec(), Vec::new()).fingerprints()?;
    let (submissions, next) = ledger::read(batch.directory, scheduler.name())?;
    let numbers = batch.jobs.iter().enumerate().map(|(i, job)| (job.name.clone(), i));
    let mut campaign = Campaign {
        scheduler,
        batch,
        asked,
        numbers: numbers.collect(),
        handed: vec![false; batch.jobs.len()],
        submissions,
        next,
        ended: BTreeMap::new(),
        silent: 0,
    };
    campaign.adopt()?;
    let mut pause = Duration::from_secs(1);
    loop {
        campaign.collect(finished)?;
        campaign.submit()?;
        if campaign.handed.iter().all(|handed| *handed) {
            return Ok(());
        }
        let longest = Duration::from_secs_f64(scheduler.rules().poll);
        std::thread::sleep(pause.min(longest));
        pause = pause.mul_f64(1.5).min(longest);
        campaign.collect(finished)?;
        campaign.judge(finished)?;
    }
}

/// How many answers in a row a scheduler may owe.
const SILENCE: usize = 100;

struct Campaign<'a> {
    scheduler: &'a dyn Scheduler,
    batch: &'a Batch<'a>,
    /// The hash of what is asked of each job.
    asked: Vec<String>,
    numbers: BTreeMap<String, usize>,
    handed: Vec<bool>,
    submissions: Vec<Submission>,
    /// The number of the next submission.
    next: usize,
    /// When tasks were first seen to have ended, by submission and task.
    ended: BTreeMap<(usize, usize), Instant>,
    /// How many times in a row the scheduler did not answer.
    silent: usize,
}

impl Campaign<'_> {
    fn runs(&self) -> &Path {
        self.batch.directory
    }

    /// Takes up what an earlier process left: finds the numbers that it could not write down, and closes what was
    /// cancelled since, which is to be submitted anew.
    fn adopt(&mut self) -> Result<(), Stop> {
        let runs = self.batch.directory;
        for submission in self.submissions.iter_mut().filter(|s| !s.is_over()) {
            // What is not asked for has been handed over.
            close(submission, |run| !self.numbers.contains_key(run));
            if submission.job.is_none() {
                submission.job = self.scheduler.find(&submission.name)?;
            }
            if submission.job.is_none() && !left_traces(submission, runs) {
                // The scheduler never heard of it.
                close(submission, |_| true);
            }
            submission.write(runs)?;
        }
        let open: Vec<&Submission> = self.submissions.iter().filter(|s| !s.is_over()).collect();
        if open.is_empty() {
            return Ok(());
        }
        let states = self.scheduler.states(&open)?;
        for submission in self.submissions.iter_mut().filter(|s| !s.is_over()) {
            let cancelled = |task: usize| {
                let state = states.get(&(submission.number, task));
                matches!(state, Some(TaskState::Failed(Cause::Cancelled, _)))
            };
            let gone: Vec<String> = submission
                .open()
                .filter(|(task, _)| cancelled(*task))
                .map(|(_, run)| run.clone())
                .collect();
            close(submission, |run| gone.iter().any(|gone| gone == run));
            submission.write(runs)?;
        }
        Ok(())
    }

    /// Hands over the runs that have left a marker.
    fn collect(&mut self, finished: Hand<'_>) -> Result<(), Stop> {
        for index in 0..self.handed.len() {
            if self.handed[index] {
                continue;
            }
            let name = &self.batch.jobs[index].name;
            let Some(marker) = Marker::read(self.runs(), name, &self.asked[index]) else {
                continue;
            };
            let outcome = match marker.outcome {
                Outcome::Done { made, .. } => Ok(made),
                Outcome::Failed { reason } => Err(reason),
                Outcome::Hopeless { reason } => {
                    Marker::set_aside(self.runs(), name)?;
                    return self.give_up().and(Err(Stop::new(reason)));
                }
            };
            let failed = outcome.is_err();
            self.handed[index] = true;
            finished(Finished { index, outcome, seconds: marker.seconds })?;
            if failed {
                Marker::set_aside(self.runs(), name)?;
            }
            self.settle(&name.clone(), Settled::Marked)?;
        }
        Ok(())
    }

    /// Takes back what is submitted when no run can have a result; the next attempt submits it anew.
    fn give_up(&mut self) -> Result<(), Stop> {
        let open: Vec<&Submission> =
            self.submissions.iter().filter(|s| !s.is_over() && s.job.is_some()).collect();
        self.scheduler.cancel(&open)?;
        for submission in &mut self.submissions {
            close(submission, |_| true);
            submission.write(self.batch.directory)?;
        }
        Ok(())
    }

    /// Notes how a run ended in the submission in which it is open.
    fn settle(&mut self, run: &str, how: Settled) -> Result<(), Stop> {
        let holds = |s: &&mut Submission| s.open().any(|(_, open)| open == run);
        if let Some(submission) = self.submissions.iter_mut().find(holds) {
            submission.settled.insert(run.to_owned(), how);
            submission.write(self.batch.directory)?;
        }
        Ok(())
    }

    /// Submits the runs that are in no submission.
    fn submit(&mut self) -> Result<(), Stop> {
        let open: std::collections::BTreeSet<&String> =
            self.submissions.iter().flat_map(|s| s.open().map(|(_, run)| run)).collect();
        let is_free = |&i: &usize| !self.handed[i] && !open.contains(&self.batch.jobs[i].name);
        let free: Vec<usize> = (0..self.handed.len()).filter(is_free).collect();
        if free.is_empty() {
            return Ok(());
        }
        let waits = self.submissions.iter().any(|submission| !submission.is_over());
        let (batch, next) = (self.batch, &mut self.next);
        match pack::submit(self.scheduler, batch, &free, &mut self.submissions, next) {
            // A user may have no more than so many jobs: there is room when some have ended.
            Err(_) if waits => Ok(()),
            result => result,
        }
    }

    /// Asks the scheduler and judges the tasks that have ended without a word of their runs.
    fn judge(&mut self, finished: Hand<'_>) -> Result<(), Stop> {
        let open: Vec<&Submission> = self.submissions.iter().filter(|s| !s.is_over()).collect();
        if open.is_empty() {
            return Ok(());
        }
        let states = match self.scheduler.states(&open) {
            Ok(states) => states,
            // A scheduler that is being restarted is no reason to give up; nor is it one to submit anything again.
            Err(_) if self.silent < SILENCE => {
                self.silent += 1;
                return Ok(());
            }
            Err(stop) => return Err(stop),
        };
        self.silent = 0;
        let tasks: std::collections::BTreeSet<(usize, usize)> =
            open.iter().flat_map(|s| s.open().map(|(task, _)| (s.number, task))).collect();
        let patience = Duration::from_secs_f64(self.scheduler.rules().patience);
        let mut due = Vec::new();
        for key in tasks {
            if matches!(states.get(&key), Some(TaskState::Waiting(_) | TaskState::Running(_))) {
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
        let folder = submission.folder(self.runs());
        let runs: Vec<String> =
            submission.open().filter(|(t, _)| *t == task).map(|(_, run)| run.clone()).collect();
        let (cause, words) = verdict(state, &folder, task);
        let job = submission.job.clone().unwrap_or_default();
        let said = tail_of_file(&folder.join(format!("task{task}.txt")));
        let begun: Vec<&String> = runs.iter().filter(|run| self.was_begun(run, number)).collect();
        let others_ended = submission.tasks[task].len() > runs.len();
        let charged: Vec<String> = if cause == Cause::Timeout && others_ended {
            // The time went to other runs of the pack.
            Vec::new()
        } else if begun.is_empty() || cause.concerns_all() {
            runs.clone()
        } else {
            begun.into_iter().cloned().collect()
        };
        for run in runs {
            if !charged.contains(&run) {
                self.settle(&run, Settled::NotBegun)?;
                continue;
            }
            let repeats = ledger::repeats(&self.submissions, &run);
            let again = repeats.get(&cause).copied().unwrap_or(0)
                < self.scheduler.rules().retry.after(cause);
            if again {
                self.settle(&run, Settled::Repeated(cause))?;
                continue;
            }
            if let Some(&index) = self.numbers.get(&run)
                && !self.handed[index]
            {
                let tail = if said.is_empty() { String::new() } else { format!(": {said}") };
                let reason = format!("job {job}, task {task}: {cause} ({words}){tail}");
                self.handed[index] = true;
                finished(Finished { index, outcome: Err(reason), seconds: 0.0 })?;
            }
            self.settle(&run, Settled::GivenUp(cause))?;
        }
        Ok(())
    }

    fn was_begun(&self, run: &str, number: usize) -> bool {
        let Some(&index) = self.numbers.get(run) else { return false };
        Begun::read(self.runs(), run).is_some_and(|begun| {
            begun.order == number.to_string() && begun.asked == self.asked[index]
        })
    }
}

/// Takes open runs out of a submission, without a word on how they ended.
fn close(submission: &mut Submission, which: impl Fn(&str) -> bool) {
    let open = submission.open().map(|(_, run)| run.clone());
    let runs: Vec<String> = open.filter(|run| which(run)).collect();
    submission.settled.extend(runs.into_iter().map(|run| (run, Settled::NotBegun)));
}

/// Whether a task of a submission was ever run.
fn left_traces(submission: &Submission, runs: &Path) -> bool {
    let folder = submission.folder(runs);
    (0..submission.tasks.len()).any(|task| folder.join(format!("task{task}.txt")).exists())
        || files::read_json::<Order>(&folder.join("order.json")).is_err()
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
        (_, Some(code)) => (Cause::Failure, format!("exit code {code}")),
        (Some(TaskState::Ended), None) => {
            (Cause::Failure, "it ended without a word of the run".to_owned())
        }
        _ => (Cause::Lost, "and it left no exit code".to_owned()),
    }
}
