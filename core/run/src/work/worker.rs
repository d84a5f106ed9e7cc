//! Implementation of `lacuna work`: some runs of an order, on the machine on which it was started.

use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use lacuna::plugin::Model;
use lacuna::plugin::executor::{Batch, Job, Recipe};
use lacuna::run::{Stop, files};

use super::{Begun, Limits, Marker, Order, Outcome, evaluate, memory, now};

/// Assignment of a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assignment {
    /// Folder of the order.
    pub order: PathBuf,
    /// Index of the task; `None` for runs named on standard input, those of one line in one call of the model.
    pub task: Option<usize>,
    /// Number of runs of a task made in parallel.
    pub parallel: usize,
    /// Limits on the use of the machine.
    pub limits: Limits,
}

/// Name of this machine.
pub fn hostname() -> String {
    #[cfg(unix)]
    return rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    return std::env::var("COMPUTERNAME").unwrap_or_default();
}

/// A worker that has read its order.
struct Worker<'a> {
    batch: Batch<'a>,
    asked: Vec<String>,
    /// Name of the order's folder.
    order: String,
    host: String,
}

/// Receives the model of an order.
pub type Then<'a> = &'a mut (dyn FnMut(&dyn Model) -> Result<(), Stop> + Send);

/// Builds the model of an order, whose runs lie in this folder, and hands it over.
pub type WithModel<'a> = dyn Fn(&Recipe, &Path, Then<'_>) -> Result<(), Stop> + 'a;

/// Makes the runs of an assignment; each leaves a marker. A run that already has one is not repeated.
///
/// Lines read from the input are answered
/// (`done run001 run002`), for a caller that hands out runs one by one.
pub fn work(
    assignment: &Assignment,
    with_model: &WithModel<'_>,
    input: &mut (dyn BufRead + Send),
    output: &mut (dyn Write + Send),
) -> Result<(), Stop> {
    assignment.limits.apply()?;
    let order = Order::read(&assignment.order)?;
    let runs = runs_folder(&assignment.order, &order)?;
    let (asked, name) = (order.fingerprints()?, name_of(&assignment.order)?);
    with_model(&order.model, &runs, &mut |model| {
        let worker = Worker {
            batch: order.batch(model, &runs),
            asked: asked.clone(),
            order: name.clone(),
            host: hostname(),
        };
        match assignment.task {
            Some(task) => worker.task(jobs_of(&order, task)?, assignment.parallel.max(1)),
            None => worker.lines(input, output),
        }
    })
}

fn jobs_of(order: &Order, task: usize) -> Result<&[usize], Stop> {
    order.tasks.get(task).map(Vec::as_slice).ok_or_else(|| {
        let last = order.tasks.len().saturating_sub(1);
        Stop::new(format!("the order has no task {task}, only 0 to {last}"))
    })
}

fn name_of(folder: &Path) -> Result<String, Stop> {
    let folder = folder.canonicalize().map_err(|error| files::cannot_read(folder, &error))?;
    Ok(folder.file_name().unwrap_or_default().to_string_lossy().into_owned())
}

fn runs_folder(order_folder: &Path, order: &Order) -> Result<PathBuf, Stop> {
    let folder = order_folder.join(&order.runs);
    folder.canonicalize().map_err(|error| files::cannot_read(&folder, &error))
}

impl Worker<'_> {
    /// Makes the runs of a task, several in parallel.
    fn task(&self, jobs: &[usize], parallel: usize) -> Result<(), Stop> {
        let size = self.batch.model.batch().max(1);
        let (next, halt) = (AtomicUsize::new(0), AtomicBool::new(false));
        let stopped = Mutex::new(None);
        std::thread::scope(|scope| {
            for _ in 0..parallel.min(jobs.len()) {
                scope.spawn(|| {
                    while !halt.load(Ordering::Relaxed) {
                        let first = next.fetch_add(size, Ordering::Relaxed);
                        let some: Vec<usize> =
                            jobs.iter().skip(first).take(size).copied().collect();
                        if some.is_empty() {
                            break;
                        }
                        if let Err(stop) = self.make(&some) {
                            halt.store(true, Ordering::Relaxed);
                            let mut first =
                                stopped.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                            first.get_or_insert(stop);
                        }
                    }
                });
            }
        });
        let stopped = stopped.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        stopped.map_or(Ok(()), Err)
    }

    /// Makes runs as they are named on the input, until it ends.
    fn lines(&self, input: &mut dyn BufRead, output: &mut dyn Write) -> Result<(), Stop> {
        let lost =
            |error| Stop::new(format!("the process that hands out the runs is gone: {error}"));
        let mut line = String::new();
        while input.read_line(&mut line).map_err(lost)? > 0 {
            let find = |name: &str| {
                let job = self.batch.jobs.iter().position(|job| job.name == name);
                job.ok_or_else(|| Stop::new(format!("the order has no run `{name}`")))
            };
            let jobs = line.split_whitespace().map(find).collect::<Result<Vec<_>, _>>()?;
            self.make(&jobs)?;
            writeln!(output, "done {}", line.trim()).map_err(lost)?;
            output.flush().map_err(lost)?;
            line.clear();
        }
        Ok(())
    }

    /// Makes several runs in one call of the model.
    fn make(&self, jobs: &[usize]) -> Result<(), Stop> {
        let runs = self.batch.directory;
        let name = |i: usize| &self.batch.jobs[i].name;
        let is_missing = |&i: &usize| Marker::read(runs, name(i), &self.asked[i]).is_none();
        let missing: Vec<usize> = jobs.iter().copied().filter(is_missing).collect();
        for &i in &missing {
            let begun = Begun {
                asked: self.asked[i].clone(),
                order: self.order.clone(),
                host: self.host.clone(),
                process: std::process::id(),
                since: now(),
            };
            begun.write(runs, name(i))?;
        }
        if missing.is_empty() {
            return Ok(());
        }
        let some: Vec<&Job> = missing.iter().map(|&i| &self.batch.jobs[i]).collect();
        let mut hopeless = None;
        let killed = memory::killed();
        let ended = evaluate(&self.batch, &some);
        let memory_ran_out = memory::killed() > killed;
        for (&i, ended) in missing.iter().zip(ended) {
            let mut marker =
                Marker::of(runs, &self.asked[i], ended.outcome, ended.seconds, &self.host)?;
            marker.out_of_memory =
                memory_ran_out && matches!(marker.outcome, Outcome::Failed { .. });
            marker.write(runs, name(i))?;
            if let Outcome::Hopeless { reason } = marker.outcome {
                hopeless.get_or_insert(reason);
            }
        }
        hopeless.map_or(Ok(()), |reason| Err(Stop::new(reason)))
    }
}
