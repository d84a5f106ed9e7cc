#![allow(clippy::unwrap_used)]
//! Answers recorded from HyperQueue (0.26, built from source); `tests/hyperqueue` of the workspace uses a real
//! server.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::plugin::Executor;
use lacuna::plugin::registry::from_text;

use super::*;
use crate::executors::cluster::{Cause, TaskState};

fn options(text: &str) -> HyperQueue {
    let built = from_text::<dyn Executor>("hyperqueue", text).unwrap();
    toml::Value::Table(built.options).try_into().unwrap()
}

const INFO: &str = r#"[{"info": {"id": 2, "name": "lacuna-1-ab", "task_count": 6,
  "task_stats": {"aborted": 0, "canceled": 1, "failed": 3, "finished": 1, "running": 1, "waiting": 0}},
  "tasks": [
    {"id": 0, "state": "finished", "started_at": "2026-01-01T00:00:00Z", "worker": 1},
    {"id": 1, "state": "failed", "error": "Program terminated with exit code 7.", "worker": 1},
    {"id": 2, "state": "failed", "error": "Time limit reached", "worker": 1},
    {"id": 3, "state": "canceled"},
    {"id": 4, "state": "running", "worker": 2},
    {"id": 5, "state": "failed", "error": "Task was running on a worker that was lost; the task has occurred 5 times in this situation and limit was reached."}
  ]}]"#;

fn submission(name: &str) -> Submission {
    Submission {
        executor: "hyperqueue".to_owned(),
        number: 1,
        name: name.to_owned(),
        place: PathBuf::new(),
        job: Some("2".to_owned()),
        submitted: 0,
        time: 1.0,
        memory: 1.0,
        tasks: (0..7).map(|i| vec![format!("run{i}")]).collect(),
        settled: BTreeMap::new(),
    }
}

#[test]
fn information_on_a_job_is_understood() {
    let mut states = BTreeMap::new();
    state::read(INFO, &submission("lacuna-1-ab"), &mut states).unwrap();
    let cause = |task: usize| match &states[&(1, task)] {
        TaskState::Failed(cause, _) => Some(*cause),
        _ => None,
    };
    let causes = [Cause::Failure, Cause::Timeout, Cause::Cancelled].map(Some);
    assert_eq!([1, 2, 3].map(cause), causes);
    assert_eq!(cause(5), Some(Cause::NodeFailure));
    assert_eq!(states[&(1, 0)], TaskState::Ended);
    assert_eq!(states[&(1, 4)], TaskState::Running("worker 2".to_owned()));
    assert_eq!(states[&(1, 6)], TaskState::Waiting("waiting".to_owned()));
    // The same job number on another server is not ours.
    states.clear();
    state::read(INFO, &submission("lacuna-1-cd"), &mut states).unwrap();
    assert!(states.is_empty());
    assert!(state::read("Error: no server", &submission("x"), &mut states).is_err());
}

#[test]
fn jobs_are_found_by_name() {
    let list = r#"[{"id": 1, "name": "other"}, {"id": 2, "name": "lacuna-1-ab"}]"#;
    assert_eq!(state::find(list, "lacuna-1-ab").unwrap(), Some("2".to_owned()));
    assert_eq!(state::find("[]", "lacuna-1-ab").unwrap(), None);
    assert_eq!(state::submitted("{\n  \"id\": 12\n}\n"), Some("12".to_owned()));
}

#[test]
fn words_are_those_of_the_study() {
    let queue = options(
        "cpus = 8\ntime = '2 h'\nresources = { mem = '16000' }\nextra = ['--pin=taskset']\n\
         allocation = { manager = 'pbs', time = '12 h', backlog = 2, arguments = ['-qqprod'] }",
    );
    let plan = Plan {
        folder: Path::new("/run/campaign/1"),
        study: Path::new("/study"),
        name: "lacuna-1-ab",
        tasks: 7,
        time: 1.5,
        memory: 1.0,
    };
    let expected = "submit --name=lacuna-1-ab --array=0-6 --cwd=/study --stdout=none --stderr=none --cpus=8 \
                    --resource=mem=16000 --time-limit=10800s --time-request=10800s --pin=taskset \
                    -- bash /run/campaign/1/task.sh";
    assert_eq!(queue.words(&plan, Path::new("/run/campaign/1/task.sh")).join(" "), expected);
    let words = queue.allocation.unwrap().words("lacuna-x").join(" ");
    assert_eq!(words, "alloc add pbs --name=lacuna-x --time-limit=43200s --backlog=2 -- -qqprod");
}
