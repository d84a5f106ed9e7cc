//! `slurm` with several nodes: models that use several nodes, nodes that fail, jobs that are preempted.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use super::jobs::{QUICKLY, on, wait_for};
use super::{failures, run, study};
use crate::slurm::{Kind, Slurm, started};

/// One Slurm for all tests, since starting it takes the longest; the tests that damage its nodes come last.
#[test]
fn several_nodes() {
    let Some(slurm) = started(Kind::Nodes) else { return };
    a_run_may_have_several_nodes(&slurm);
    a_job_that_gave_way_is_submitted_again(&slurm);
    a_job_whose_node_failed_is_submitted_again(&slurm);
}

fn a_run_may_have_several_nodes(slurm: &Slurm) {
    let script = "srun printenv SLURMD_NODENAME | sort | xargs > \"$3/nodes-$1\"; echo \"[$2]\"";
    let (folder, path) = study(script, &format!("{QUICKLY}nodes = 2\ntasks = 2"));
    let out = folder.path().join("run");
    let (code, text) = on(slurm, &mut run(&path, &out, &["design.runs=3"]));
    assert_eq!(code, Some(0), "{text}");
    let names = slurm.ask("sinfo", &["-h", "-N", "-p", "debug", "-o", "%N"]);
    let names: Vec<&str> = names.split_whitespace().collect();
    assert_eq!(names.len(), 2);
    for run in ["run001", "run002", "run003"] {
        let nodes = fs::read_to_string(folder.path().join(format!("nodes-{run}"))).unwrap();
        assert_eq!(nodes.trim(), names.join(" "), "{run}");
    }
}

/// A run that the first time records its process and waits.
const WAITS: &str = "if [ $1 = run001 ] && [ ! -e \"$3/first\" ]; then
    echo $PPID $(cut -d ' ' -f 4 /proc/$PPID/stat) $SLURMD_NODENAME > \"$3/first.part\"
    mv \"$3/first.part\" \"$3/first\"
    sleep 60
fi
echo $SLURMD_NODENAME > \"$3/node-$1\"
echo \"[$2]\"";

/// Starts a study whose first run waits; returns the recorded words.
fn waiting(slurm: &Slurm, path: &Path, out: &Path) -> (Child, Vec<String>) {
    let mut command = run(path, out, &[]);
    command.env("SLURM_CONF", slurm.conf()).stdout(Stdio::null()).stderr(Stdio::null());
    let child = command.spawn().unwrap();
    let first = path.with_file_name("first");
    wait_for("the first run", || first.exists());
    let said = fs::read_to_string(first).unwrap();
    (child, said.split_whitespace().map(str::to_owned).collect())
}

/// Reason recorded when the first run was submitted again.
fn cause(out: &Path) -> String {
    let file = out.join("2-simulate/campaign/1/submission.json");
    let text = fs::read_to_string(file).unwrap();
    let submission: serde_json::Value = serde_json::from_str(&text).unwrap();
    submission["settled"]["run001"]["repeated"].as_str().unwrap_or("nothing").to_owned()
}

fn a_job_that_gave_way_is_submitted_again(slurm: &Slurm) {
    let (folder, path) = study(WAITS, QUICKLY);
    let out = folder.path().join("run");
    let (mut child, _) = waiting(slurm, &path, &out);
    slurm.ask(
        "sbatch",
        &["-p", "urgent", "-N", "2", "--exclusive", "-o", "/dev/null", "--wrap", "sleep 1"],
    );
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(cause(&out), "preempted");
}

fn a_job_whose_node_failed_is_submitted_again(slurm: &Slurm) {
    let (folder, path) = study(WAITS, QUICKLY);
    let (here, out) = (folder.path().join("here"), folder.path().join("run"));
    let (mut child, said) = waiting(slurm, &path, &out);
    let [worker, shell, node] = &said[..] else { panic!("{said:?}") };
    // The others have ended, so that the node is all that is left of the job.
    let done = || outcomes_on_disk(&out) == 5;
    wait_for("the end of the others", done);
    let step = fs::read_to_string(format!("/proc/{shell}/stat")).unwrap();
    let step = step.rsplit(')').next().unwrap().split_whitespace().nth(1).unwrap().to_owned();
    for process in [&of_node(slurm, node), &step, shell, worker] {
        let killed = Command::new("kill").args(["-9", process]).status().unwrap();
        assert!(killed.success(), "{said:?}");
    }
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(cause(&out), "node_failure");
    let again = fs::read_to_string(folder.path().join("node-run001")).unwrap();
    assert_ne!(again.trim(), node);
    let local = run(&path, &here, &["executor={ use = \"local\" }"]).output().unwrap();
    assert!(local.status.success());
    // The table contains the hash of every response.
    for file in ["2-simulate/runs.csv", "posterior.nc"] {
        let hash = |folder: &Path| lacuna::run::files::hash_file(&folder.join(file)).unwrap();
        assert_eq!(hash(&out), hash(&here), "{file}");
    }
    assert_eq!(failures(&out), []);
}

/// Process number of the daemon that represents a node.
fn of_node(slurm: &Slurm, name: &str) -> String {
    let file = slurm.conf().with_file_name(format!("slurmd-{name}.pid"));
    fs::read_to_string(file).unwrap().trim().to_owned()
}

fn outcomes_on_disk(out: &Path) -> usize {
    fs::read_dir(out.join("2-simulate/campaign/done")).map_or(0, Iterator::count)
}
