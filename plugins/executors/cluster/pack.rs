//! Runs into tasks, tasks into submissions.

use std::collections::BTreeMap;

use lacuna::plugin::executor::{Batch, Job};
use lacuna::run::{Stop, files};
use lacuna::work::{self, Order};

use super::ledger::{self, Submission};
use super::{Cause, Plan, Scheduler};

/// Hands runs to the scheduler: those that need the same limits together. `next` is a free number, and is moved on.
pub fn submit(
    scheduler: &dyn Scheduler,
    batch: &Batch<'_>,
    runs: &[usize],
    earlier: &mut Vec<Submission>,
    next: &mut usize,
) -> Result<(), Stop> {
    let rules = scheduler.rules();
    let mut groups: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for &i in runs {
        let repeats = ledger::repeats(earlier, &batch.jobs[i].name);
        let count = |cause: Cause| repeats.get(&cause).copied().unwrap_or(0);
        groups.entry((count(Cause::Timeout), count(Cause::OutOfMemory))).or_default().push(i);
    }
    let most = scheduler.most_tasks()?.max(1) * rules.pack;
    for ((timeouts, shortages), runs) in groups {
        let time = rules.grow.time.get().powi(timeouts as i32);
        let memory = rules.grow.memory.get().powi(shortages as i32);
        for some in runs.chunks(most) {
            let jobs: Vec<Job> = some.iter().map(|&i| batch.jobs[i].clone()).collect();
            let submission = one(scheduler, batch, jobs, *next, (time, memory))?;
            earlier.push(submission);
            *next += 1;
        }
    }
    Ok(())
}

/// Makes one submission. It is on disk under a name of its own before the scheduler hears of it, so that it is found
/// again whenever this process is killed.
fn one(
    scheduler: &dyn Scheduler,
    batch: &Batch<'_>,
    jobs: Vec<Job>,
    number: usize,
    (time, memory): (f64, f64),
) -> Result<Submission, Stop> {
    let all: Vec<usize> = (0..jobs.len()).collect();
    let tasks: Vec<Vec<usize>> =
        all.chunks(scheduler.rules().pack).map(<[usize]>::to_vec).collect();
    let order = Order::new(batch, jobs, tasks);
    let folder = ledger::folder(batch.directory, number);
    order.write(&folder)?;
    let folder = folder
        .canonicalize()
        .map_err(|error| files::cannot_read(&ledger::folder(batch.directory, number), &error))?;
    let submitted = work::now();
    // Two campaigns of one user must not take each other's jobs for their own.
    let mark =
        files::hash(format!("{}{submitted}{}", folder.display(), std::process::id()).as_bytes());
    let mut submission = Submission {
        executor: scheduler.name().to_owned(),
        number,
        name: format!("lacuna-{number}-{}", &mark[..10]),
        job: None,
        submitted,
        time,
        memory,
        tasks: ledger::tasks_of(&order),
        settled: BTreeMap::new(),
    };
    let name = submission.name.clone();
    let plan = Plan {
        folder: &folder,
        study: &order.study,
        name: &name,
        tasks: order.tasks.len(),
        time,
        memory,
    };
    scheduler.write(&plan)?;
    submission.write(batch.directory)?;
    match scheduler.submit(&plan) {
        Ok(job) => submission.job = Some(job),
        Err(stop) => {
            // It refused: nothing of it is anywhere.
            let path = folder.join("submission.json");
            std::fs::remove_file(&path).map_err(|error| files::cannot_write(&path, &error))?;
            return Err(stop);
        }
    }
    submission.write(batch.directory)?;
    Ok(submission)
}
