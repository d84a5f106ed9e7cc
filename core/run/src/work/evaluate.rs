//! Jobs run in this process.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::Instant;

use lacuna::plugin::executor::{Batch, Job, Written};
use lacuna::plugin::model::{Call, EvalError, Response};

use crate::write_response;

/// Outcome of a job in this process.
#[derive(Debug)]
pub struct Ended {
    /// The response as written to a file, or the reason why there is none.
    pub outcome: Result<Written, EvalError>,
    /// Duration, in seconds.
    pub seconds: f64,
}

/// Runs several jobs in one call of the model and writes their responses to files; the time is divided equally among
/// them.
///
/// A panic of the model fails only the run in which it occurred.
pub fn evaluate(batch: &Batch<'_>, jobs: &[&Job]) -> Vec<Ended> {
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
                catch_unwind(AssertUnwindSafe(|| keep(batch, job, call, &response)))
                    .unwrap_or_else(|_| Err(panicked()))
            })
            .collect(),
        Err(_) if jobs.len() > 1 => {
            return jobs.iter().flat_map(|job| evaluate(batch, &[job])).collect();
        }
        Err(_) => vec![Err(panicked())],
    };
    let seconds = begun.elapsed().as_secs_f64() / jobs.len() as f64;
    outcomes.into_iter().map(|outcome| Ended { outcome, seconds }).collect()
}

fn panicked() -> EvalError {
    EvalError::Rejected("the model panicked".to_owned())
}

/// Writes a response to a file.
fn keep(
    batch: &Batch<'_>,
    job: &Job,
    call: &Call<'_>,
    response: &Response,
) -> Result<Written, EvalError> {
    if let Some(i) = response.values.iter().position(|y| !y.is_finite()) {
        let place = batch.layout.describe(i);
        return Err(EvalError::Rejected(format!(
            "the response is {} at {place}",
            response.values[i]
        )));
    }
    let file = match batch.model.write(&job.name, call, response, batch.directory)? {
        Some(file) => file,
        None => write_response(batch.directory, &job.name, batch.layout, response)
            .map_err(|stop| EvalError::Fatal(stop.to_string()))?,
    };
    Ok(Written { file, valid: response.valid })
}
