//! JSON answers of `hq`.

use lacuna::run::Stop;
use serde_json::Value;

use crate::executors::cluster::{Cause, States, Submission, TaskState};

fn json(text: &str) -> Result<Value, Stop> {
    serde_json::from_str(text).map_err(|error| {
        let first = text.lines().next().unwrap_or_default();
        Stop::new(format!("`hq` gave no JSON ({error}): `{first}`"))
    })
}

/// Returns the number of a job from `{"id": 1}`.
pub fn submitted(text: &str) -> Option<String> {
    json(text).ok()?["id"].as_u64().map(|id| id.to_string())
}

/// Returns the number of the job of this name in the list of all jobs.
pub fn find(text: &str, name: &str) -> Result<Option<String>, Stop> {
    let jobs = json(text)?;
    let mut jobs = jobs.as_array().into_iter().flatten();
    let ours = jobs.find(|job| job["name"] == name);
    Ok(ours.and_then(|job| job["id"].as_u64()).map(|id| id.to_string()))
}

/// Reads the states of a submission's tasks from the information on its job.
pub fn read(text: &str, submission: &Submission, states: &mut States) -> Result<(), Stop> {
    let jobs = json(text)?;
    // A restarted server may count from one again: another job may have this number.
    let mut jobs = jobs.as_array().into_iter().flatten();
    let Some(job) = jobs.find(|job| job["info"]["name"] == submission.name.as_str()) else {
        return Ok(());
    };
    for task in job["tasks"].as_array().into_iter().flatten() {
        if let Some(number) = task["id"].as_u64() {
            states.insert((submission.number, number as usize), state(task));
        }
    }
    // Some versions list only the tasks that have begun and omit those that wait.
    for task in 0..submission.tasks.len() {
        let waits = || TaskState::Waiting("waiting".to_owned());
        states.entry((submission.number, task)).or_insert_with(waits);
    }
    Ok(())
}

fn state(task: &Value) -> TaskState {
    let word = task["state"].as_str().unwrap_or_default();
    let error = task["error"].as_str().unwrap_or(word);
    match word {
        "finished" => TaskState::Ended,
        "running" => TaskState::Running(place(task)),
        "failed" => TaskState::Failed(cause(error), error.to_owned()),
        // A job that was stopped because too many of its tasks failed aborts its other tasks.
        "canceled" | "aborted" => TaskState::Failed(Cause::Cancelled, word.to_owned()),
        _ => TaskState::Waiting(word.to_owned()),
    }
}

fn place(task: &Value) -> String {
    match (&task["worker"], &task["workers"]) {
        (Value::Number(worker), _) => format!("worker {worker}"),
        (_, Value::Array(workers)) => {
            let numbers: Vec<String> = workers.iter().map(ToString::to_string).collect();
            format!("workers {}", numbers.join(", "))
        }
        _ => "a worker".to_owned(),
    }
}

fn cause(error: &str) -> Cause {
    let text = error.to_lowercase();
    if text.contains("time limit") {
        Cause::Timeout
    } else if text.contains("worker") && (text.contains("lost") || text.contains("crash")) {
        Cause::NodeFailure
    } else {
        Cause::Failure
    }
}
