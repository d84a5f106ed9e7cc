//! `local` with several processes.

use std::fs;

use super::{failures, run, study};
use crate::quick;

#[test]
fn processes_give_the_bits_that_threads_give() {
    let folder = quick::simulated();
    let (path, threads, processes) = (
        folder.path().join("study.toml"),
        folder.path().join("threads"),
        folder.path().join("processes"),
    );
    for (out, setting) in [(&threads, "executor.threads=2"), (&processes, "executor.processes=3")] {
        let (code, text) = quick::said(&mut run(&path, out, &[setting]));
        assert_eq!(code, Some(0), "{text}");
    }
    assert_eq!(quick::results(&processes), quick::results(&threads));
    assert!(processes.join("2-simulate/campaign/done/run040.json").exists());
}

#[test]
fn a_process_that_dies_costs_its_own_run() {
    // The parent of the command is the process that makes the run.
    let script = "case $1 in run003) kill -9 $PPID;; run005) exit 7;; esac; echo \"[$2]\"";
    let (folder, path) = study(script, "use = \"local\"\nprocesses = 2");
    let out = folder.path().join("run");
    let (code, text) = quick::said(&mut run(&path, &out, &[]));
    assert_eq!(code, Some(1), "{text}");
    let failed = failures(&out);
    assert_eq!(failed.len(), 2, "{failed:?}");
    assert_eq!(failed[0].0, "run003");
    assert!(failed[0].1.contains("was ended by signal 9"), "{failed:?}");
    assert!(failed[1].1.contains("exit code 7"), "{failed:?}");
    // The next attempt makes only those two.
    fs::write(folder.path().join("model.sh"), "echo \"[$2]\"").unwrap();
    let log = || fs::read_to_string(out.join("2-simulate/progress.jsonl")).unwrap();
    let before = log().lines().count();
    assert_eq!(before, 6);
    // Another script is another model; with the original script the study continues where it was.
    fs::write(folder.path().join("model.sh"), script).unwrap();
    let (code, _) = quick::said(&mut run(&path, &out, &[]));
    assert_eq!((code, log().lines().count()), (Some(1), 8));
}

#[cfg(target_os = "linux")]
#[test]
fn processes_keep_to_their_processors_and_their_memory() {
    let script = "echo \"[$(nproc)]\"; echo $(nproc) $(ulimit -d) > \"$3/seen-$1\"";
    let (folder, path) =
        study(script, "use = \"local\"\nprocesses = 2\npin = true\nmemory = \"512 MiB\"");
    let out = folder.path().join("run");
    // A constant response cannot be fitted, so the study fails later; only the runs matter here.
    let _ = quick::said(&mut run(&path, &out, &[]));
    let all = std::thread::available_parallelism().unwrap().get();
    for i in 1..=6 {
        let seen = fs::read_to_string(folder.path().join(format!("seen-run00{i}"))).unwrap();
        let numbers: Vec<usize> = seen.split_whitespace().map(|n| n.parse().unwrap()).collect();
        assert!(numbers[0] <= all.div_ceil(2), "{seen} of {all} processors");
        assert_eq!(numbers[1], 512 * 1024, "kilobytes");
    }
}

#[test]
fn a_program_that_is_not_there_is_complained_about() {
    let executor =
        "use = \"local\"\nprocesses = 2\nprogram = \"lacuna-that-is-not-there\"\nthreads = 1";
    let (folder, path) = study("echo \"[$2]\"", executor);
    let (code, text) = quick::said(&mut run(&path, &folder.path().join("run"), &[]));
    assert_eq!(code, Some(2));
    assert!(text.contains("expected `threads` or `processes`"), "{text}");
    let (code, text) = quick::said(&mut run(
        &path,
        &folder.path().join("run"),
        &["executor={ use = \"local\", processes = 2, program = \"lacuna-that-is-not-there\" }"],
    ));
    assert_eq!(code, Some(2));
    assert!(text.contains("there is no program `lacuna-that-is-not-there`"), "{text}");
}
