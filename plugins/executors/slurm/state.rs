//! States of tasks from Slurm's output in formats defined here: its JSON output changes between versions.

use std::collections::{BTreeMap, BTreeSet};

use lacuna::run::Stop;

use super::reasons;
use crate::executors::cluster::{Cause, States, Submission, TaskState};
use crate::executors::command::said;

/// Returns the job number from the output of `sbatch --parsable`: the last line, `12` or `12;cluster`. Plugins and
/// wrappers of a site may print other lines before it.
pub fn submitted(text: &str) -> Option<String> {
    let last = text.lines().map(str::trim).rfind(|line| !line.is_empty())?;
    let number = last.split(';').next()?;
    let is_number = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| number.to_owned())
}

/// Queries the states of the tasks of some submissions.
pub fn states(submissions: &[&Submission]) -> Result<States, Stop> {
    let names: Vec<&str> = submissions.iter().map(|s| s.name.as_str()).collect();
    // By name, because asking for a job number that Slurm has forgotten is an error.
    let queue = said(
        "squeue",
        &["-h", "-r", "-t", "all", "--name", &names.join(","), "-o", "%j|%i|%T|%N|%r"],
    )?;
    let mut states = of_queue(&queue, submissions);
    let is_missing = |s: &&Submission| {
        s.job.is_some() && s.open().any(|(task, _)| !states.contains_key(&(s.number, task)))
    };
    let missing: Vec<&Submission> = submissions.iter().copied().filter(is_missing).collect();
    if !missing.is_empty() {
        let jobs: Vec<&str> = missing.iter().filter_map(|s| s.job.as_deref()).collect();
        // Without accounting this fails, and the exit codes on disk must suffice.
        let accounts = said(
            "sacct",
            &["-X", "-n", "-P", "-j", &jobs.join(","), "-o", "JobID,JobName,State,ExitCode"],
        );
        if let Ok(text) = accounts {
            for (key, state) in of_accounts(&text, &missing) {
                states.entry(key).or_insert(state);
            }
        }
    }
    explain(&mut states, submissions);
    Ok(states)
}

/// Parses lines `name|job_task|STATE|node|reason`.
pub fn of_queue(text: &str, submissions: &[&Submission]) -> States {
    let mut states = States::new();
    for line in text.lines() {
        let cells: Vec<&str> = line.splitn(5, '|').collect();
        let [name, id, state, node, reason] = cells[..] else { continue };
        let Some(submission) = submissions.iter().find(|s| s.name == name) else { continue };
        let Some(task) = task_of(id) else { continue };
        states.insert((submission.number, task), state_of(state, node, reason));
    }
    states
}

/// Parses lines `job_task|name|STATE and more|code:signal`; tasks that have not ended are left to the queue.
pub fn of_accounts(text: &str, submissions: &[&Submission]) -> States {
    let mut states = States::new();
    for line in text.lines() {
        let cells: Vec<&str> = line.splitn(4, '|').collect();
        let [id, name, state, code] = cells[..] else { continue };
        // Job numbers are reused; names are unique.
        let Some(submission) = submissions.iter().find(|s| s.name == name) else { continue };
        let Some(task) = task_of(id) else { continue };
        let state = state_of(state, "", code);
        if matches!(state, TaskState::Ended | TaskState::Failed(..)) {
            states.insert((submission.number, task), state);
        }
    }
    states
}

/// Returns the index of a task: `12_4` is task 4; `12_[5-9%2]` stands for several waiting tasks.
fn task_of(id: &str) -> Option<usize> {
    id.split_once('_')?.1.parse().ok()
}

fn state_of(state: &str, node: &str, reason: &str) -> TaskState {
    // Such as `CANCELLED by 0`.
    let word = state.split_whitespace().next().unwrap_or_default().trim_end_matches('+');
    let words = || {
        let reason = if reason == "None" { "" } else { reason };
        format!("{word} {reason}").trim().to_owned()
    };
    let failed = |cause| TaskState::Failed(cause, words());
    match word {
        "COMPLETED" => TaskState::Ended,
        "RUNNING" | "COMPLETING" | "CONFIGURING" | "SUSPENDED" | "STOPPED" | "SIGNALING"
        | "STAGE_OUT" | "RESIZING" => TaskState::Running(node.to_owned()),
        "TIMEOUT" | "DEADLINE" => failed(Cause::Timeout),
        "OUT_OF_MEMORY" => failed(Cause::OutOfMemory),
        "NODE_FAIL" | "BOOT_FAIL" => failed(Cause::NodeFailure),
        "PREEMPTED" => failed(Cause::Preempted),
        "CANCELLED" => failed(Cause::Cancelled),
        "FAILED" => failed(Cause::Failure),
        "PENDING" | "REQUEUED" if reasons::is_passing(reason) => TaskState::Waiting(words()),
        "PENDING" | "REQUEUED" => TaskState::Held(format!("{word} {}", reasons::explained(reason))),
        "REQUEUE_HOLD" | "SPECIAL_EXIT" | "RESV_DEL_HOLD" => TaskState::Held(words()),
        "REVOKED" => {
            TaskState::Held("REVOKED: another cluster of the federation has it".to_owned())
        }
        // States of later versions: the task has not ended.
        _ => TaskState::Waiting(words()),
    }
}

/// Adds the exit code or the signal to tasks that failed, if the scheduler still knows it.
fn explain(states: &mut States, submissions: &[&Submission]) {
    for submission in submissions {
        let Some(job) = &submission.job else { continue };
        let open: BTreeSet<usize> = submission.open().map(|(task, _)| task).collect();
        let number = submission.number;
        let failed = |task: &usize| {
            matches!(states.get(&(number, *task)), Some(TaskState::Failed(Cause::Failure, _)))
        };
        if !open.iter().any(failed) {
            continue;
        }
        // One query for the whole array.
        let Ok(text) = said("scontrol", &["-o", "show", "job", job]) else { continue };
        for (task, code) in exit_codes(&text) {
            if let Some(TaskState::Failed(Cause::Failure, words)) = states.get_mut(&(number, task))
            {
                *words = format!("{words}, {code}");
            }
        }
    }
}

/// Returns the exit codes of the tasks of an array, from one line for each.
pub fn exit_codes(text: &str) -> BTreeMap<usize, String> {
    let task = |line: &str| {
        let mut words = line.split_whitespace();
        words.find_map(|word| word.strip_prefix("ArrayTaskId="))?.parse().ok()
    };
    text.lines().filter_map(|line| Some((task(line)?, exit_code(line)?))).collect()
}

/// Parses `ExitCode=7:0` as an exit code and `ExitCode=0:9` as a signal.
fn exit_code(text: &str) -> Option<String> {
    let value = text.split_whitespace().find_map(|word| word.strip_prefix("ExitCode="))?;
    let (code, signal) = value.split_once(':')?;
    match (code, signal) {
        ("0", "0") => None,
        ("0", signal) => Some(format!("ended by signal {signal}")),
        (code, _) => Some(format!("exit code {code}")),
    }
}

/// Returns the maximum array size from Slurm's configuration.
pub fn max_array_size(config: &str) -> Option<usize> {
    let line = config.lines().find(|line| line.trim_start().starts_with("MaxArraySize"))?;
    line.split_once('=')?.1.trim().parse().ok()
}
