//! `slurm` tested with a real scheduler.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::{failures, outcomes, run, study};
use crate::quick;
use crate::slurm::{Kind, Slurm, started};

pub(super) const QUICKLY: &str = "use = \"slurm\"\npoll = 1\npatience = 1\n";

pub(super) fn on(slurm: &Slurm, command: &mut Command) -> (Option<i32>, String) {
    quick::said(command.env("SLURM_CONF", slurm.conf()))
}

pub(super) fn resume(out: &Path) -> Command {
    let mut command = quick::command();
    command.arg("resume").arg(out);
    command
}

pub(super) fn wait_for(what: &str, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what} does not come");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Number of jobs ever submitted; an array counts once.
pub(super) fn submissions(out: &Path) -> usize {
    let campaign = out.join("2-simulate/campaign");
    let entries = fs::read_dir(campaign).unwrap().flatten();
    entries.filter(|entry| entry.path().join("submission.json").exists()).count()
}

#[test]
fn a_cluster_gives_the_bits_that_this_machine_gives() {
    let Some(slurm) = started(Kind::Plain) else { return };
    let folder = quick::simulated();
    let (path, here, there) =
        (folder.path().join("study.toml"), folder.path().join("here"), folder.path().join("there"));
    let (code, text) = quick::said(&mut run(&path, &here, &[]));
    assert_eq!(code, Some(0), "{text}");
    let executor = "executor={ use = \"slurm\", pack = 6, at_most = 2, poll = 1, patience = 1 }";
    let (code, text) = on(&slurm, &mut run(&path, &there, &[executor]));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(quick::results(&there), quick::results(&here));
    // 40 runs, six per job: one array of seven tasks.
    assert_eq!(submissions(&there), 1);
    let script = fs::read_to_string(there.join("2-simulate/campaign/1/job.sh")).unwrap();
    assert!(script.contains("#SBATCH --array=0-6%2\n"), "{script}");
    let codes = (0..7).map(|task| {
        let file = there.join(format!("2-simulate/campaign/1/task{task}.exit"));
        fs::read_to_string(file).unwrap()
    });
    assert!(codes.into_iter().all(|code| code == "0\n"));
}

/// Events for six runs, two per job: an exit code of the model; its job killed; cancelled from outside; the others
/// succeed.
const TROUBLE: &str = "case $1 in
    run002) exit 7;;
    run004) kill -9 $PPID;;
    run006) touch \"$3/cancel-me\"; sleep 60;;
esac
echo \"[$2]\"";

fn each_cause_is_told(kind: Kind) {
    let Some(slurm) = started(kind) else { return };
    let (folder, path) = study(TROUBLE, &format!("{QUICKLY}pack = 2"));
    let out = folder.path().join("run");
    let mut command = run(&path, &out, &[]);
    command.env("SLURM_CONF", slurm.conf()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    wait_for("the run to cancel", || folder.path().join("cancel-me").exists());
    let queue = slurm.ask("squeue", &["-h", "-r", "-t", "running", "-o", "%i"]);
    let last = queue.lines().find(|id| id.ends_with("_2")).unwrap().to_owned();
    slurm.ask("scancel", &[&last]);
    assert_eq!(child.wait().unwrap().code(), Some(1));
    let failed = failures(&out);
    let names: Vec<&str> = failed.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["run002", "run004", "run006"], "{failed:?}");
    assert!(failed[0].1.contains("exit code 7"), "{failed:?}");
    assert!(
        failed[1].1.contains("it failed") && failed[1].1.contains("exit code 137"),
        "{failed:?}"
    );
    assert!(failed[2].1.contains("it was cancelled"), "{failed:?}");
    // The next attempt submits only those three.
    fs::remove_file(folder.path().join("cancel-me")).unwrap();
    let before = submissions(&out);
    let mut again = resume(&out);
    again.env("SLURM_CONF", slurm.conf()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = again.spawn().unwrap();
    wait_for("the run to cancel", || folder.path().join("cancel-me").exists());
    child.kill().unwrap();
    child.wait().unwrap();
    let text =
        fs::read_to_string(out.join(format!("2-simulate/campaign/{}/order.json", before + 1)));
    let order: serde_json::Value = serde_json::from_str(&text.unwrap()).unwrap();
    assert_eq!(order["jobs"].as_array().unwrap().len(), 3);
}

#[test]
fn each_cause_is_told_without_accounts() {
    each_cause_is_told(Kind::Plain);
}

#[test]
fn each_cause_is_told_with_accounts() {
    each_cause_is_told(Kind::Accounting);
}

#[test]
fn a_killed_process_submits_nothing_twice() {
    let Some(slurm) = started(Kind::Plain) else { return };
    let script =
        "echo $1 >> \"$3/made\"; while [ ! -e \"$3/go\" ]; do sleep 0.1; done; echo \"[$2]\"";
    let (folder, path) = study(script, QUICKLY);
    let out = folder.path().join("run");
    let mut command = run(&path, &out, &[]);
    command.env("SLURM_CONF", slurm.conf()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    let made = || fs::read_to_string(folder.path().join("made")).unwrap_or_default();
    wait_for("the first run", || !made().is_empty());
    child.kill().unwrap();
    child.wait().unwrap();
    // As if the program had been killed before it recorded the job number.
    let file = out.join("2-simulate/campaign/1/submission.json");
    let text = fs::read_to_string(&file).unwrap();
    let mut submission: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(submission["job"].is_string());
    submission["job"] = serde_json::Value::Null;
    fs::write(&file, submission.to_string()).unwrap();
    fs::write(folder.path().join("go"), "").unwrap();
    let (code, text) = on(&slurm, &mut resume(&out));
    assert_eq!(code, Some(0), "{text}");
    let mut runs: Vec<String> = made().lines().map(str::to_owned).collect();
    runs.sort();
    let names: Vec<String> = outcomes(&out).into_iter().map(|(name, _)| name).collect();
    assert_eq!(runs, names, "each run was made once");
    assert_eq!(submissions(&out), 1);
}

#[test]
fn a_time_limit_is_told_and_a_longer_one_given() {
    let Some(slurm) = started(Kind::Plain) else { return };
    // Slurm's time limits are in minutes. The first run of one pack and the second of the other exceed the limit of
    // their jobs.
    let script = "case $1 in run001|run005)
    if [ -e \"$3/again-$1\" ]; then touch \"$3/longer-$1\"; else touch \"$3/again-$1\"; sleep 300; fi;;
esac
echo \"[$2]\"";
    let executor = format!(
        "{QUICKLY}pack = 3\ntime = \"1 min\"\nretry = {{ timeout = 1 }}\ngrow = {{ time = 2 }}"
    );
    let (folder, path) = study(script, &executor);
    let out = folder.path().join("run");
    let (code, text) = on(&slurm, &mut run(&path, &out, &[]));
    assert_eq!(code, Some(0), "{text}");
    for run in ["run001", "run005"] {
        assert!(folder.path().join(format!("longer-{run}")).exists(), "{run}");
    }
    // Only the run that had its job to itself gets a longer limit; the others are submitted again unchanged.
    let longer = |n: usize| {
        let folder = out.join(format!("2-simulate/campaign/{n}"));
        let script = fs::read_to_string(folder.join("job.sh")).unwrap();
        let order = fs::read_to_string(folder.join("order.json")).unwrap();
        script.contains("--time=0-00:02:00").then(|| {
            assert!(order.contains("run001") && !order.contains("run005"), "{order}");
        })
    };
    assert_eq!((1..=submissions(&out)).filter_map(longer).count(), 1);
}
