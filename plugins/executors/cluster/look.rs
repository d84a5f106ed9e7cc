//! What can be said and done of a campaign from its folder alone.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::plugin::executor::Seen;
use lacuna::run::Stop;

use super::ledger::{self, Submission};
use super::{Scheduler, TaskState};

/// The runs that the scheduler has.
pub fn look(scheduler: &dyn Scheduler, runs: &Path) -> Result<Vec<Seen>, Stop> {
    let (mut all, _) = ledger::read(runs, scheduler.name())?;
    all.retain(|submission| !submission.is_over());
    let open: Vec<&Submission> = all.iter().collect();
    let states = if open.is_empty() { BTreeMap::new() } else { scheduler.states(&open)? };
    let mut seen = Vec::new();
    for submission in &all {
        let job = submission.job.as_deref().unwrap_or("not known yet");
        for (task, run) in submission.open() {
            let (running, note) = match states.get(&(submission.number, task)) {
                Some(TaskState::Waiting(why)) => (false, format!("job {job}, task {task}: {why}")),
                Some(TaskState::Running(place)) => {
                    (true, format!("job {job}, task {task} on {place}"))
                }
                Some(TaskState::Failed(cause, _)) => {
                    (false, format!("job {job}, task {task} has ended: {cause}"))
                }
                Some(TaskState::Ended) => (false, format!("job {job}, task {task} has ended")),
                None => {
                    (false, format!("job {job}, task {task}: the scheduler does not know of it"))
                }
            };
            seen.push(Seen { run: run.clone(), running, note });
        }
    }
    Ok(seen)
}

/// Ends all that the scheduler has.
pub fn cancel(scheduler: &dyn Scheduler, runs: &Path) -> Result<usize, Stop> {
    let (mut all, _) = ledger::read(runs, scheduler.name())?;
    all.retain(|submission| !submission.is_over());
    for submission in all.iter_mut().filter(|submission| submission.job.is_none()) {
        submission.job = scheduler.find(&submission.name)?;
    }
    let open: Vec<&Submission> = all.iter().filter(|s| s.job.is_some()).collect();
    if !open.is_empty() {
        scheduler.cancel(&open)?;
    }
    Ok(open.iter().map(|submission| submission.open().count()).sum())
}
