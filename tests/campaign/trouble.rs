//! `slurm` under faults: of its replies, of the preparation of a run, of resource limits.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};

use super::jobs::{QUICKLY, on, resume, submissions, wait_for};
use super::verbs::{campaign, made, printed};
use super::{outcomes, run, study};
use crate::quick;
use crate::slurm::{Kind, Slurm, started};

/// One Slurm for all tests, since starting it takes the longest.
#[test]
fn troubles() {
    let Some(slurm) = started(Kind::Nodes) else { return };
    what_comes_before_a_run_costs_no_run(&slurm);
    memory_that_runs_out_is_told_and_more_is_given(&slurm);
    a_campaign_is_cancelled_and_goes_on(&slurm);
    why_jobs_wait_is_told(&slurm);
}

/// A model that records each call.
const NOTED: &str = "echo $1 >> \"$3/made\"; echo \"[$2]\"";

/// A program or a module that the nodes do not have; then an `sbatch` whose reply is lost.
fn what_comes_before_a_run_costs_no_run(slurm: &Slurm) {
    let (folder, path) = study(NOTED, QUICKLY);
    let out = folder.path().join("run 100% it's");
    for (setting, words) in [
        ("executor.program=/nowhere/lacuna", "there is no program `/nowhere/lacuna` on "),
        ("executor.modules=[\"nothing/1\"]", "`module load nothing/1` of `modules` ended"),
        ("executor.setup=[\"cd /nowhere\"]", "`cd /nowhere` of `setup` ended with exit code 1"),
    ] {
        let (code, text) = on(slurm, &mut run(&path, &out, &[setting]));
        assert_eq!(code, Some(1), "{text}");
        assert!(text.contains("it ended before it began a run") && text.contains(words), "{text}");
        assert!(text.contains("`program` in `[executor]`"), "{text}");
    }
    let log = fs::read_to_string(out.join("2-simulate/progress.jsonl")).unwrap();
    assert_eq!(log, "", "no run has failed");
    let before = submissions(&out);
    let mut again = run(&path, &out, &[]);
    again.env("PATH", with_a_deaf_sbatch(folder.path()));
    let (code, text) = on(slurm, &mut again);
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(submissions(&out), before + 1);
    let names: Vec<String> = outcomes(&out).into_iter().map(|(name, _)| name).collect();
    assert_eq!(made(folder.path()), names, "each run was made once");
}

/// A `PATH` in which `sbatch` submits the jobs and then fails.
fn with_a_deaf_sbatch(folder: &Path) -> std::ffi::OsString {
    let deaf = folder.join("deaf");
    fs::create_dir(&deaf).unwrap();
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let real = std::env::split_paths(&paths).map(|p| p.join("sbatch")).find(|p| p.exists());
    let text = format!(
        "#!/bin/sh\n'{}' \"$@\" > /dev/null || exit\n\
         echo 'sbatch: error: Batch job submission failed: Socket timed out on send/recv operation' >&2\nexit 1\n",
        real.unwrap().display()
    );
    fs::write(deaf.join("sbatch"), text).unwrap();
    let executable = Command::new("chmod").arg("+x").arg(deaf.join("sbatch")).status().unwrap();
    assert!(executable.success());
    let all = std::iter::once(deaf).chain(std::env::split_paths(&paths));
    std::env::join_paths(all).unwrap()
}

fn memory_that_runs_out_is_told_and_more_is_given(slurm: &Slurm) {
    // `tail` buffers a line until it ends, and this one does not end. If memory is only monitored and not limited,
    // detection takes a moment.
    let script = "case $1 in
    run001) echo $1 >> \"$3/made\"; bytes=300000000;;
    run002) bytes=900000000;;
    *) bytes=1;;
esac
(head -c $bytes /dev/zero; [ $bytes = 1 ] || sleep 2) | tail -n 1 > /dev/null || exit 5
echo \"[$2]\"";
    let executor = format!(
        "{QUICKLY}memory = \"200 MiB\"\nretry = {{ out_of_memory = 1 }}\ngrow = {{ memory = 2 }}"
    );
    let (folder, path) = study(script, &executor);
    let out = folder.path().join("run");
    let (code, text) = on(slurm, &mut run(&path, &out, &[]));
    assert_eq!(code, Some(1), "{text}");
    assert_eq!(made(folder.path()), ["run001", "run001"], "{text}");
    let failed = super::failures(&out);
    assert_eq!(failed.len(), 1, "{failed:?}");
    assert!(failed[0].0 == "run002" && failed[0].1.contains("it ran out of memory"), "{failed:?}");
    let script = fs::read_to_string(out.join("2-simulate/campaign/2/job.sh")).unwrap();
    assert!(script.contains("#SBATCH --mem=409600K\n"), "{script}");
}

fn a_campaign_is_cancelled_and_goes_on(slurm: &Slurm) {
    let script =
        "echo $1 >> \"$3/made\"; while [ ! -e \"$3/go\" ]; do sleep 0.1; done; echo \"[$2]\"";
    let (folder, path) = study(script, &format!("{QUICKLY}at_most = 2"));
    let out = folder.path().join("run");
    let mut command = run(&path, &out, &[]);
    command.env("SLURM_CONF", slurm.conf()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    wait_for("two runs", || made(folder.path()).len() == 2);
    let state = || printed(campaign(&["status"], &out).env("SLURM_CONF", slurm.conf()));
    let table = state();
    assert!(table.contains("2 running, 4 waiting"), "{table}");
    child.kill().unwrap();
    child.wait().unwrap();
    let said = printed(campaign(&["cancel"], &out).env("SLURM_CONF", slurm.conf()));
    assert!(said.starts_with("6 runs cancelled"), "{said}");
    fs::write(folder.path().join("go"), "").unwrap();
    // Immediately: runs that are still ending do not count as failed.
    let (code, text) = on(slurm, &mut resume(&out));
    assert_eq!(code, Some(0), "{text}");
    assert!(submissions(&out) >= 2);
    // And again when all have ended.
    fs::remove_file(folder.path().join("go")).unwrap();
    fs::remove_dir_all(&out).unwrap();
    let mut command = run(&path, &out, &[]);
    command.env("SLURM_CONF", slurm.conf()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    wait_for("the runs", || out.join("2-simulate/campaign/1/submission.json").exists());
    wait_for("two runs", || state().contains("2 running, 4 waiting"));
    child.kill().unwrap();
    child.wait().unwrap();
    printed(campaign(&["cancel"], &out).env("SLURM_CONF", slurm.conf()));
    wait_for("the end of all", || state().starts_with("2-simulate: 6 runs, 6 missing"));
    assert!(state().contains("has ended: it was cancelled"), "{}", state());
    fs::write(folder.path().join("go"), "").unwrap();
    let (code, text) = on(slurm, &mut resume(&out));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(submissions(&out), 2);
}

fn why_jobs_wait_is_told(slurm: &Slurm) {
    let executor = format!("{QUICKLY}partition = \"short\"\ntime = \"2 h\"");
    let (folder, path) = study(NOTED, &executor);
    let out = folder.path().join("run");
    let said = folder.path().join("said");
    let mut command = run(&path, &out, &[]);
    command.env("SLURM_CONF", slurm.conf()).stdout(Stdio::null());
    // The study takes precedence over the environment.
    command.env("SBATCH_TIMELIMIT", "1").env("SBATCH_PARTITION", "debug");
    let mut child = command.stderr(File::create(&said).unwrap()).spawn().unwrap();
    let words = "6 jobs wait for a reason other than the queue: PENDING PartitionTimeLimit: \
                 `time` is more than the partition allows";
    let told = || fs::read_to_string(&said).unwrap().matches(words).count();
    wait_for("the reason", || told() > 0);
    let table = printed(campaign(&["status"], &out).env("SLURM_CONF", slurm.conf()));
    assert!(table.contains("6 waiting") && table.contains("PartitionTimeLimit"), "{table}");
    let job = slurm.ask("squeue", &["-h", "-p", "short", "-o", "%F"]);
    let job = job.lines().next().unwrap().to_owned();
    slurm.ask("scontrol", &["update", &format!("JobId={job}"), "TimeLimit=1"]);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(told(), 1, "{}", fs::read_to_string(&said).unwrap());
    assert_eq!(quick::summary(&out)["runs"]["used"], 6);
}
