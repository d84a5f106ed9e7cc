//! From a batch of runs to their results, through a scheduler.

mod adopt;
mod judge;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::{Duration, Instant};

use lacuna::plugin::executor::{Batch, Finished};
use lacuna::run::Stop;
use lacuna_run::work::{Marker, Order, Outcome};

use super::ledger::{self, Settled, Submission};
use super::{Cause, Scheduler, look, pack};

type Hand<'h> = &'h mut dyn FnMut(Finished) -> Result<(), Stop>;

/// Runs the jobs of a batch and reports each as it ends. Runs submitted earlier are not submitted again.
pub fn follow(
    scheduler: &dyn Scheduler,
    batch: &Batch<'_>,
    finished: Hand<'_>,
) -> Result<(), Stop> {
    if batch.jobs.is_empty() {
        return Ok(());
    }
    let mut campaign = Campaign::new(scheduler, batch)?;
    campaign.adopt()?;
    let mut pause = Duration::from_secs(1);
    loop {
        campaign.collect(finished)?;
        campaign.submit()?;
        if campaign.handed.iter().all(|handed| *handed) {
            return Ok(());
        }
        let longest = scheduler.rules().poll;
        std::thread::sleep(pause.min(longest));
        pause = pause.mul_f64(1.5).min(longest);
        campaign.collect(finished)?;
        campaign.judge(finished)?;
    }
}

struct Campaign<'a> {
    scheduler: &'a dyn Scheduler,
    batch: &'a Batch<'a>,
    /// Fingerprint of each job's inputs.
    asked: Vec<String>,
    numbers: BTreeMap<String, usize>,
    handed: Vec<bool>,
    submissions: Vec<Submission>,
    /// Number of the next submission.
    next: usize,
    /// Submissions whose jobs were being cancelled when this process began.
    withdrawn: BTreeSet<usize>,
    /// Time of the first unsuccessful query for the number of a submission.
    unheard: BTreeMap<usize, Instant>,
    /// Time at which tasks were first seen to have ended, by submission and task.
    ended: BTreeMap<(usize, usize), Instant>,
    /// Number of consecutive queries that the scheduler did not answer.
    silent: usize,
    /// Reasons for waiting that have been reported.
    told: BTreeSet<String>,
}

impl<'a> Campaign<'a> {
    fn new(scheduler: &'a dyn Scheduler, batch: &'a Batch<'a>) -> Result<Self, Stop> {
        let asked = Order::new(batch, batch.jobs.to_vec(), Vec::new()).fingerprints()?;
        let (submissions, next) = ledger::read(batch.directory, scheduler.name())?;
        let numbers = batch.jobs.iter().enumerate().map(|(i, job)| (job.name.clone(), i));
        Ok(Self {
            scheduler,
            batch,
            asked,
            numbers: numbers.collect(),
            handed: vec![false; batch.jobs.len()],
            submissions,
            next,
            withdrawn: BTreeSet::new(),
            unheard: BTreeMap::new(),
            ended: BTreeMap::new(),
            silent: 0,
            told: BTreeSet::new(),
        })
    }

    fn runs(&self) -> &'a Path {
        self.batch.directory
    }

    fn patience(&self) -> Duration {
        self.scheduler.rules().patience
    }

    /// Reports the runs that have left a marker.
    fn collect(&mut self, finished: Hand<'_>) -> Result<(), Stop> {
        let marked = Marker::names(self.runs());
        for index in 0..self.handed.len() {
            let name = &self.batch.jobs[index].name;
            if self.handed[index] || !marked.contains(name) {
                continue;
            }
            let Some(marker) = Marker::read(self.runs(), name, &self.asked[index]) else {
                continue;
            };
            if marker.out_of_memory && self.gets_more_memory(name)? {
                continue;
            }
            let outcome = match marker.outcome {
                Outcome::Done { made, .. } => Ok(made),
                Outcome::Failed { reason } if marker.out_of_memory => {
                    Err(format!("{}: {reason}", Cause::OutOfMemory))
                }
                Outcome::Failed { reason } => Err(reason),
                Outcome::Hopeless { reason } => return Err(self.give_up(Stop::new(reason))),
            };
            let failed = outcome.is_err();
            self.handed[index] = true;
            finished(Finished { index, outcome, seconds: marker.seconds })?;
            if failed {
                Marker::set_aside(self.runs(), name)?;
            }
            self.settle(name, Settled::Marked)?;
        }
        Ok(())
    }

    /// Submits a run again whose model was killed for lack of memory, if `retry` permits; returns true if it does.
    /// The job continues with its other runs.
    fn gets_more_memory(&mut self, run: &str) -> Result<bool, Stop> {
        let cause = Cause::OutOfMemory;
        let is_open = self.submissions.iter().any(|s| s.open().any(|(_, open)| open == run));
        let repeats = ledger::repeats(&self.submissions, run);
        let allowed = self.scheduler.rules().retry.after(cause);
        if !is_open || repeats.get(&cause).copied().unwrap_or(0) >= allowed {
            return Ok(false);
        }
        Marker::set_aside(self.runs(), run)?;
        self.settle(run, Settled::Repeated(cause))?;
        Ok(true)
    }

    /// Cancels what is submitted if no run can have a result; the next attempt submits it again.
    fn give_up(&self, why: Stop) -> Stop {
        let open: Vec<&Submission> =
            self.submissions.iter().filter(|s| !s.is_over() && s.job.is_some()).collect();
        let ended = look::end(self.scheduler, &open, self.runs());
        let cleared = self.clear_hopeless(|_| true);
        match ended.and(cleared) {
            Ok(()) => why,
            // The first error explains more.
            Err(also) => Stop {
                message: format!("{}\nand its jobs could not be ended: {also}", why.message),
                ..why
            },
        }
    }

    /// Sets aside the markers of some runs that declare all runs hopeless: they have been reported, or no process
    /// waited for them.
    fn clear_hopeless(&self, which: impl Fn(&str) -> bool) -> Result<(), Stop> {
        let mut of_ours = self.batch.jobs.iter().map(|job| &job.name).filter(|name| which(name));
        of_ours.try_for_each(|name| Marker::clear_hopeless(self.runs(), name))
    }

    /// Records how a run ended in the submission in which it is open.
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
        let open: BTreeSet<&String> =
            self.submissions.iter().flat_map(|s| s.open().map(|(_, run)| run)).collect();
        let is_free = |&i: &usize| !self.handed[i] && !open.contains(&self.batch.jobs[i].name);
        let free: Vec<usize> = (0..self.handed.len()).filter(is_free).collect();
        if free.is_empty() {
            return Ok(());
        }
        let (batch, next) = (self.batch, &mut self.next);
        let submitted = pack::submit(self.scheduler, batch, &free, &mut self.submissions, next);
        let Err(stop) = submitted else { return Ok(()) };
        // The number of jobs per user may be limited: there is room again when some have ended.
        if self.submissions.iter().any(|s| !s.is_over() && s.job.is_some()) {
            self.tell("refused", || {
                format!(
                    "not all runs are submitted yet; Lacuna tries again when jobs have ended: {}",
                    stop.message
                )
            });
            return Ok(());
        }
        Err(stop)
    }

    /// Reports something to the user, once.
    fn tell(&mut self, what: &str, words: impl FnOnce() -> String) {
        if self.told.insert(what.to_owned()) {
            (self.batch.warn)(&words());
        }
    }
}

#[cfg(test)]
mod tests;
