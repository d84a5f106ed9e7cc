#![allow(clippy::unwrap_used)]
//! Answers recorded from Slurm 22.05; a real one is used in the tests of the workspace.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::plugin::Executor;
use lacuna::plugin::registry::from_text;

use super::state::{exit_codes, max_array_size, of_accounts, of_queue, submitted};
use super::*;
use crate::executors::cluster::{Cause, TaskState};

fn submission(number: usize, name: &str, job: &str) -> Submission {
    let run = |i: usize| vec![format!("run00{i}")];
    Submission {
        executor: "slurm".to_owned(),
        number,
        name: name.to_owned(),
        place: PathBuf::new(),
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
    let text = "JobId=9 ArrayJobId=8 ArrayTaskId=0 Reboot=0 ExitCode=7:0 RunTime=1\n\
                JobId=10 ArrayJobId=8 ArrayTaskId=1 Reboot=0 ExitCode=0:9 RunTime=1\n\
                JobId=8 ArrayJobId=8 ArrayTaskId=2 Reboot=0 ExitCode=0:0 RunTime=1\n";
    let codes = exit_codes(text);
    assert_eq!(codes.len(), 2);
    assert_eq!((&*codes[&0], &*codes[&1]), ("exit code 7", "ended by signal 9"));
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

#[test]
fn a_number_is_found_behind_what_a_site_prints() {
    let number = Some("12".to_owned());
    for text in ["12\n", "12;cluster\n", "Welcome to the cluster.\n\n12\n", "12\r\n"] {
        assert_eq!(submitted(text), number, "{text}");
    }
    for text in ["", "\n", ";cluster", "Submitted batch job", "12 jobs left"] {
        assert_eq!(submitted(text), None, "{text}");
    }
}

#[test]
fn states_that_are_seldom_seen_are_understood() {
    let ours = submission(1, "lacuna-1-ab", "2");
    let state = |word: &str, reason: &str| {
        let states = of_queue(&format!("lacuna-1-ab|2_0|{word}|n1|{reason}\n"), &[&ours]);
        states[&(1, 0)].clone()
    };
    let cause = |word: &str| match state(word, "None") {
        TaskState::Failed(cause, _) => cause,
        other => panic!("{word}: {other:?}"),
    };
    for (word, expected) in [
        ("CANCELLED+", Cause::Cancelled),
        ("NODE_FAIL", Cause::NodeFailure),
        ("BOOT_FAIL", Cause::NodeFailure),
        ("PREEMPTED", Cause::Preempted),
        ("DEADLINE", Cause::Timeout),
    ] {
        assert_eq!(cause(word), expected, "{word}");
    }
    for word in ["COMPLETING", "SUSPENDED", "CONFIGURING"] {
        assert_eq!(state(word, "None"), TaskState::Running("n1".to_owned()));
    }
    // A requeued job will run again, and a revoked one runs in another cluster.
    for (word, reason) in [("REQUEUED", "BeginTime"), ("PENDING", "Priority")] {
        assert!(matches!(state(word, reason), TaskState::Waiting(_)), "{word}");
    }
    for (word, reason) in
        [("REVOKED", "None"), ("REQUEUE_HOLD", "None"), ("PENDING", "JobHeldAdmin")]
    {
        assert!(matches!(state(word, reason), TaskState::Held(_)), "{word}");
    }
    let held = TaskState::Held(
        "PENDING PartitionTimeLimit: `time` is more than the partition allows".to_owned(),
    );
    assert_eq!(state("PENDING", "PartitionTimeLimit"), held);
    // The index of a task in all the ways in which it is written.
    let text = "lacuna-1-ab|2_[3-5%2]|PENDING||None\nlacuna-1-ab|2|PENDING||None\n";
    assert_eq!(of_queue(text, &[&ours]), BTreeMap::new());
}

#[test]
fn options_by_which_jobs_would_be_lost_are_refused() {
    for (line, is_refused) in [
        ("--array=0-3", true),
        ("-J other", true),
        ("-Jother", true),
        ("--clusters=far", true),
        ("--exclusive", false),
        ("--array-like", false),
        ("-C fast", false),
    ] {
        let found = super::own_option(line).is_some();
        assert_eq!(found, is_refused, "{line}");
    }
}
