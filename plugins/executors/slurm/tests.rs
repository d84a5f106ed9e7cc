#![allow(clippy::unwrap_used)]
//! Answers as Slurm 22.05 gave them; a real one is asked in the tests of the whole.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::plugin::Executor;
use lacuna::plugin::registry::from_text;

use super::state::{exit_code, max_array_size, of_accounts, of_queue};
use super::*;
use crate::executors::cluster::Cause;

fn submission(number: usize, name: &str, job: &str) -> Submission {
    let run = |i: usize| vec![format!("run00{i}")];
    Submission {
        executor: "slurm".to_owned(),
        number,
        name: name.to_owned(),
        job: Some(job.to_owned()),
        submitted: 0,
        time: 1.0,
        memory: 1.0,
        tasks: (0..6).map(run).collect(),
        settled: BTreeMap::new(),
    }
}

#[test]
fn the_queue_is_understood() {
    let ours = submission(3, "lacuna-3-ab", "2");
    let text = "lacuna-3-ab|2_0|FAILED|vm|NonZeroExitCode\n\
                lacuna-3-ab|2_1|RUNNING|vm|None\n\
                lacuna-3-ab|2_2|PENDING||JobArrayTaskLimit\n\
                other|2_3|FAILED|vm|None\n\
                lacuna-3-ab|2_4|TIMEOUT|vm|TimeLimit\n\
                lacuna-3-ab|2_5|A_NEW_WORD||None\n";
    let states = of_queue(text, &[&ours]);
    let expected = [
        (0, TaskState::Failed(Cause::Failure, "FAILED NonZeroExitCode".to_owned())),
        (1, TaskState::Running("vm".to_owned())),
        (2, TaskState::Waiting("PENDING JobArrayTaskLimit".to_owned())),
        (4, TaskState::Failed(Cause::Timeout, "TIMEOUT TimeLimit".to_owned())),
        (5, TaskState::Waiting("A_NEW_WORD".to_owned())),
    ];
    let expected: BTreeMap<_, _> =
        expected.into_iter().map(|(task, state)| ((3, task), state)).collect();
    assert_eq!(states, expected);
}

#[test]
fn accounts_are_understood_and_of_other_jobs_not_believed() {
    let ours = submission(1, "lacuna-1-ab", "2");
    let text = "2_0|lacuna-1-ab|FAILED|7:0\n\
                2_1|lacuna-1-ab|OUT_OF_MEMORY|0:125\n\
                2_2|lacuna-1-ab|CANCELLED by 0|0:0\n\
                2_3|lacuna-1-ab|COMPLETED|0:0\n\
                2_4|lacuna-1-ab|RUNNING|0:0\n\
                2_[5-9%2]|lacuna-1-ab|PENDING|0:0\n\
                2_5|an older job|FAILED|1:0\n";
    let states = of_accounts(text, &[&ours]);
    let cause = |task: usize| match states.get(&(1, task)) {
        Some(TaskState::Failed(cause, _)) => Some(*cause),
        _ => None,
    };
    let causes = [Cause::Failure, Cause::OutOfMemory, Cause::Cancelled].map(Some);
    assert_eq!([0, 1, 2].map(cause), causes);
    assert_eq!(states[&(1, 3)], TaskState::Ended);
    assert_eq!(states.len(), 4, "{states:?}");
}

#[test]
fn details_are_understood() {
    assert_eq!(exit_code("Reboot=0 ExitCode=7:0 RunTime=1").unwrap(), "exit code 7");
    assert_eq!(exit_code("Reboot=0 ExitCode=0:9 RunTime=1").unwrap(), "ended by signal 9");
    assert_eq!(max_array_size("A = 1\nMaxArraySize            = 1001\n"), Some(1001));
}

#[test]
fn directives_are_those_of_the_study() {
    let options = "partition = 'batch'\naccount = 'a'\ntime = '25 h'\nmemory = '2 GiB'\n\
                   nodes = 2\nat_most = 5\nextra = ['--exclusive']\ngrow = { time = 2 }";
    let built = from_text::<dyn Executor>("slurm", options).unwrap();
    let slurm: Slurm = toml::Value::Table(built.options).try_into().unwrap();
    let plan = Plan {
        folder: Path::new("/a b/100%"),
        study: Path::new("/study"),
        name: "lacuna-1-x",
        tasks: 7,
        time: 2.0,
        memory: 1.0,
    };
    let expected = [
        "#SBATCH --job-name=lacuna-1-x",
        "#SBATCH --array=0-6%5",
        "#SBATCH --output='/a b/100%%/task%a.txt'",
        "#SBATCH --chdir='/study'",
        "#SBATCH --no-requeue",
        "#SBATCH --partition=batch",
        "#SBATCH --account=a",
        "#SBATCH --time=2-02:00:00",
        "#SBATCH --nodes=2",
        "#SBATCH --mem=2097152K",
        "#SBATCH --exclusive",
    ];
    assert_eq!(slurm.directives(&plan), expected);
}
