//! State and cancellation of a campaign, from its folder alone.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::plugin::executor::{Phase, Seen};
use lacuna::run::Stop;

use super::ledger::{self, Submission};
use super::{Scheduler, TaskState};

/// Returns the runs that the scheduler has, with their phase.
pub fn look(scheduler: &dyn Scheduler, runs: &Path) -> Result<Vec<Seen>, Stop> {
    let (mut all, _) = ledger::read(runs, scheduler.name())?;
    all.retain(|submission| !submission.is_over());
    let open: Vec<&Submission> = all.iter().collect();
    let states = if open.is_empty() { BTreeMap::new() } else { scheduler.states(&open)? };
    let mut seen = Vec::new();
    for submission in &all {
        for (task, run) in submission.open() {
            let job = submission.job.as_deref().unwrap_or("not known yet");
            let (phase, words) = sight(states.get(&(submission.number, task)));
            let note = format!("job {job}, task {task}{words}");
            seen.push(Seen { run: run.clone(), phase, note });
        }
    }
    Ok(seen)
}

fn sight(state: Option<&TaskState>) -> (Phase, String) {
    match state {
        Some(TaskState::Waiting(why) | TaskState::Held(why)) => (Phase::Waits, format!(": {why}")),
        Some(TaskState::Running(place)) => (Phase::Runs, format!(" on {place}")),
        Some(TaskState::Failed(cause, _)) => (Phase::Ended, format!(" has ended: {cause}")),
        Some(TaskState::Ended) => (Phase::Ended, " has ended".to_owned()),
        None => (Phase::Ended, ": the scheduler has no record of it".to_owned()),
    }
}

/// Cancels all jobs of a campaign; returns the number of runs affected.
pub fn cancel(scheduler: &dyn Scheduler, runs: &Path) -> Result<usize, Stop> {
    let (mut all, _) = ledger::read(runs, scheduler.name())?;
    all.retain(|submission| !submission.is_over());
    for submission in all.iter_mut().filter(|submission| submission.job.is_none()) {
        submission.job = scheduler.find(&submission.name)?;
    }
    let open: Vec<&Submission> = all.iter().filter(|s| s.job.is_some()).collect();
    end(scheduler, &open, runs)?;
    Ok(open.iter().map(|submission| submission.open().count()).sum())
}

/// Cancels the jobs of some submissions, and records it.
pub fn end(
    scheduler: &dyn Scheduler,
    submissions: &[&Submission],
    runs: &Path,
) -> Result<(), Stop> {
    let jobs: Vec<&str> = submissions.iter().filter_map(|s| s.job.as_deref()).collect();
    if jobs.is_empty() {
        return Ok(());
    }
    scheduler.cancel(&jobs)?;
    submissions.iter().try_for_each(|submission| submission.withdraw(runs))
}
