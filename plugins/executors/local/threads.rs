//! Threads of this process.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use lacuna::plugin::executor::{Batch, Finished};
use lacuna::plugin::model::EvalError;
use lacuna::run::Stop;
use lacuna_run::work::{Ended, evaluate};

/// Runs the jobs of a batch, as many at a time as there are threads, and reports each as it ends.
pub fn submit(
    threads: Option<NonZeroUsize>,
    batch: &Batch<'_>,
    finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
) -> Result<(), Stop> {
    let threads = threads.map_or_else(rayon::current_num_threads, NonZeroUsize::get);
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
                    let jobs: Vec<_> = batch.jobs.iter().skip(first).take(size).collect();
                    if jobs.is_empty() {
                        break;
                    }
                    for (i, ended) in evaluate(batch, &jobs).into_iter().enumerate() {
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

fn collect(
    receiver: &mpsc::Receiver<(usize, Ended)>,
    finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
) -> Result<(), Stop> {
    for (index, Ended { outcome, seconds }) in receiver {
        let outcome = match outcome {
            Ok(done) => Ok(done),
            Err(EvalError::Rejected(reason)) => Err(reason),
            Err(EvalError::Fatal(reason)) => return Err(Stop::new(reason)),
        };
        finished(Finished { index, outcome, seconds })?;
    }
    Ok(())
}
