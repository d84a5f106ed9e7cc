//! Grouping of runs into tasks, and of tasks into submissions.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use lacuna::plugin::executor::{Batch, Job};
use lacuna::run::{Stop, files};
use lacuna_run::work::{self, Order};

use super::ledger::{self, Submission};
use super::{Cause, Plan, Scheduler, script};

/// Submits runs to the scheduler, grouped by the limits they need. `next` is a free number and is advanced. On
/// failure, `earlier` contains everything that was, or may have been, submitted.
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
            let (submission, outcome) = one(scheduler, batch, jobs, *next, (time, memory))?;
            if let Some(submission) = submission {
                earlier.push(submission);
                *next += 1;
            }
            outcome?;
        }
    }
    Ok(())
}

/// Makes one submission; `None` with the reason if the scheduler refuses it. It is written to disk under a unique
/// name before the scheduler sees it, so that it can be found again whenever this process is killed.
fn one(
    scheduler: &dyn Scheduler,
    batch: &Batch<'_>,
    jobs: Vec<Job>,
    number: usize,
    factors: (f64, f64),
) -> Result<(Option<Submission>, Result<(), Stop>), Stop> {
    let all: Vec<usize> = (0..jobs.len()).collect();
    let tasks: Vec<Vec<usize>> =
        all.chunks(scheduler.rules().pack).map(<[usize]>::to_vec).collect();
    let order = Order::new(batch, jobs, tasks);
    let folder = ledger::folder(batch.directory, number);
    order.write(&folder)?;
    let folder = folder.canonicalize().map_err(|error| files::cannot_read(&folder, &error))?;
    let mut submission = noted(scheduler, &order, &folder, number, factors);
    let name = submission.name.clone();
    let plan = Plan {
        folder: &folder,
        study: &order.study,
        name: &name,
        tasks: order.tasks.len(),
        time: submission.time,
        memory: submission.memory,
    };
    let script = script::write(&scheduler.frame(&plan), &scheduler.worker(), &plan)?;
    submission.write(batch.directory)?;
    match scheduler.submit(&plan, &script) {
        Ok(job) => submission.job = Some(job),
        Err(stop) => match heard(scheduler, &name, &stop) {
            Ok(Some(job)) => submission.job = Some(job),
            Ok(None) => {
                submission.forget(batch.directory)?;
                return Ok((None, Err(stop)));
            }
            Err(silent) => return Ok((Some(submission), Err(unsure(&stop, &silent)))),
        },
    }
    submission.write(batch.directory)?;
    Ok((Some(submission), Ok(())))
}

fn noted(
    scheduler: &dyn Scheduler,
    order: &Order,
    folder: &Path,
    number: usize,
    (time, memory): (f64, f64),
) -> Submission {
    let submitted = work::now();
    // Two campaigns of one user must not mistake each other's jobs for their own.
    let mark =
        files::hash(format!("{}{submitted}{}", folder.display(), std::process::id()).as_bytes());
    Submission {
        executor: scheduler.name().to_owned(),
        number,
        name: format!("lacuna-{number}-{}", &mark[..10]),
        place: folder.to_owned(),
        job: None,
        submitted,
        time,
        memory,
        tasks: ledger::tasks_of(order),
        settled: BTreeMap::new(),
    }
}

/// Returns the number of a submission whose command failed, if the scheduler has accepted it nevertheless. If the
/// answer may have been lost on its way, the scheduler is asked again until the patience is used up.
fn heard(scheduler: &dyn Scheduler, name: &str, failure: &Stop) -> Result<Option<String>, Stop> {
    let patience = scheduler.rules().patience;
    let begun = Instant::now();
    loop {
        let found = scheduler.find(name)?;
        if found.is_some() || !was_lost(&failure.message) || begun.elapsed() >= patience {
            return Ok(found);
        }
        std::thread::sleep(Duration::from_secs(1).min(patience));
    }
}

/// Returns true if a command failed in communication with the scheduler, and not by the scheduler's refusal.
fn was_lost(words: &str) -> bool {
    // The part before repeats the command, whose paths may contain any of these words.
    let words = words.rsplit_once("` failed").map_or(words, |(_, said)| said).to_lowercase();
    let of_the_way = [
        "timed out",
        "timeout",
        "socket",
        "connect",
        "communication",
        "zero bytes",
        "transport",
        "message receive",
        "ended by signal",
        "in place of a number",
    ];
    of_the_way.iter().any(|sign| words.contains(sign))
}

fn unsure(failure: &Stop, silent: &Stop) -> Stop {
    Stop::new(format!(
        "it is unknown whether the scheduler has the jobs: {}; and then: {}",
        failure.message, silent.message
    ))
    .help("when the scheduler answers again, run the same command: jobs that it has are found, and nothing is submitted twice")
}
