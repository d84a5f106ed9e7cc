//! `local`: all cores of this machine.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Instant;

use lacuna::plugin::executor::{Batch, Finished, Job};
use lacuna::plugin::model::{Call, EvalError, Response};
use lacuna::plugin::{Component, Executor};
use lacuna::run::{Stop, write_response};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Runs the model on this machine, one run a thread.
///
/// Each run's result file is written as the run finishes, so a killed study loses at most the
/// runs under way. The number of threads changes the time and nothing else.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Local {
    /// Number of runs at a time; when left out, that of the command line's `--threads`, or all cores.
    pub threads: Option<std::num::NonZeroUsize>,
}

impl Component for Local {}

impl Executor for Local {
    fn submit(
        &self,
        batch: &Batch<'_>,
        finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        let threads = self.threads.map_or_else(rayon::current_num_threads, std::num::NonZero::get);
        let size = batch.model.batch().max(1);
        let next = AtomicUsize::new(0);
        let halt = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let (sender, receiver) = mpsc::channel();
            for _ in 0..threads.min(batch.jobs.len()) {
                let sender = sender.clone();
                let (next, halt) = (&next, &halt);
                scope.spawn(move || {
                    while !halt.load(Ordering::Relaxed) {
                        let first = next.fetch_add(size, Ordering::Relaxed);
                        let jobs = batch.jobs.iter().skip(first).take(size);
                        let ended = run(batch, &jobs.collect::<Vec<_>>());
                        if ended.is_empty() {
                            break;
                        }
                        for (i, ended) in ended.into_iter().enumerate() {
                            if sender.send((first + i, ended)).is_err() {
                                return;
                            }
                        }
                    }
                });
            }
            drop(sender);
            let result = collect(&receiver, finished);
            halt.store(true, Ordering::Relaxed);
            result
        })
    }
}

type Ended = (Result<(Response, String), EvalError>, f64);

fn collect(
    receiver: &mpsc::Receiver<(usize, Ended)>,
    finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
) -> Result<(), Stop> {
    for (index, (outcome, seconds)) in receiver {
        let outcome = match outcome {
            Ok(done) => Ok(done),
            Err(EvalError::Rejected(reason)) => Err(reason),
            Err(EvalError::Fatal(reason)) => return Err(Stop::new(reason)),
        };
        finished(Finished { index, outcome, seconds })?;
    }
    Ok(())
}

/// Runs some jobs in one go; the time is shared equally between them.
fn run(batch: &Batch<'_>, jobs: &[&Job]) -> Vec<Ended> {
    let begun = Instant::now();
    let folders: Vec<PathBuf> = jobs.iter().map(|job| batch.folder(job)).collect();
    let pairs = jobs.iter().zip(&folders);
    let calls: Vec<Call<'_>> = pairs.map(|(job, folder)| batch.call(job, folder)).collect();
    let responses = catch_unwind(AssertUnwindSafe(|| batch.model.predict_batch(&calls)));
    let outcomes: Vec<_> = match responses {
        Ok(responses) => responses
            .into_iter()
            .zip(jobs.iter().zip(&calls))
            .map(|(response, (job, call))| {
                let response = response?;
                catch_unwind(AssertUnwindSafe(|| keep(batch, job, call, response)))
                    .unwrap_or_else(|_| Err(panicked()))
            })
            .collect(),
        // A model that panics must cost its own run and no other.
        Err(_) if jobs.len() > 1 => {
            return jobs.iter().flat_map(|job| run(batch, &[job])).collect();
        }
        Err(_) => vec![Err(panicked())],
    };
    let seconds = begun.elapsed().as_secs_f64() / jobs.len() as f64;
    outcomes.into_iter().map(|outcome| (outcome, seconds)).collect()
}

fn panicked() -> EvalError {
    EvalError::Rejected("the model panicked".to_owned())
}

/// Writes a response down.
fn keep(
    batch: &Batch<'_>,
    job: &Job,
    call: &Call<'_>,
    response: Response,
) -> Result<(Response, String), EvalError> {
    if let Some(i) = response.values.iter().position(|y| !y.is_finite()) {
        let place = batch.layout.describe(i);
        return Err(EvalError::Rejected(format!(
            "the response is {} at {place}",
            response.values[i]
        )));
    }
    let file = match batch.model.write(&job.name, call, &response, batch.directory)? {
        Some(file) => file,
        None => write_response(batch.directory, &job.name, batch.layout, &response)
            .map_err(|stop| EvalError::Fatal(stop.to_string()))?,
    };
    Ok((response, file))
}

lacuna::register!(Executor, "local", Local);
