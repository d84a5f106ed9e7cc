//! A campaign that begins on one machine, goes on on a cluster and ends on the first, in a folder that is copied each time.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::jobs::{resume, wait_for};
use super::verbs::made;
use super::{outcomes, queue, run, study};
use crate::quick;

/// A model that notes its call and waits until its run is permitted.
const PERMITTED: &str = "echo $1 >> \"$3/made\"
until grep -q $1 \"$3/permitted\"; do sleep 0.1; done
echo \"[$2]\"";

const ONE_BY_ONE: &str = "executor={ use = \"local\", processes = 1 }";

/// Starts a command and ends it as soon as the campaign has this number of results and has begun a run.
fn until_done(command: &mut Command, folder: &Path, count: usize, begun: &str) {
    let mut child: Child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for("results", || {
        let mut status = quick::command();
        let output = status.args(["campaign", "status"]).arg(folder.join("run")).output().unwrap();
        let done = String::from_utf8_lossy(&output.stdout).contains(&format!(" {count} done"));
        done && made(folder).iter().any(|name| name == begun)
    });
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Copies the campaign's folder, with the runs that may end in the copy. Jobs on the cluster go on while it is copied, and a
/// file that one of them renames meanwhile is sought in vain: then it is copied again.
fn copied(folder: &Path, copy: &Path, permitted: &str) -> PathBuf {
    wait_for("a copy", || {
        let _ = fs::remove_dir_all(copy);
        Command::new("cp").arg("-r").arg(folder).arg(copy).status().unwrap().success()
    });
    fs::write(copy.join("permitted"), permitted).unwrap();
    copy.to_owned()
}

#[test]
fn a_campaign_moves_to_a_cluster_and_back() {
    let Some(server) = queue::started() else { return };
    let (source, _) = study(PERMITTED, "use = \"local\"");
    let root = tempfile::tempdir().unwrap();
    let whole = "run001 run002 run003 run004 run005 run006";
    let on = |folder: &Path, executor: &str| {
        run(&folder.join("study.toml"), &folder.join("run"), &[executor])
    };

    let direct = copied(source.path(), &root.path().join("direct"), whole);
    let (code, text) = quick::said(&mut on(&direct, ONE_BY_ONE));
    assert_eq!(code, Some(0), "{text}");
    let results = quick::results(&direct.join("run"));

    let laptop = copied(source.path(), &root.path().join("laptop"), "run001 run002");
    until_done(&mut on(&laptop, ONE_BY_ONE), &laptop, 2, "run003");

    let permitted = "run001 run002 run003 run004";
    let cluster = copied(&laptop, &root.path().join("cluster"), permitted);
    let executor = format!("executor={{ use = \"hyperqueue\", {} }}", server.inline());
    until_done(&mut on(&cluster, &executor), &cluster, 4, "run004");

    let back = copied(&cluster, &root.path().join("back"), whole);
    let (code, text) = quick::said(&mut on(&back, ONE_BY_ONE));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(outcomes(&back.join("run")).len(), 6);
    assert_eq!(quick::results(&back.join("run")), results);
    // Nothing that was done elsewhere was made again: only the laptop's last call was cut off.
    let calls = |run: &str| made(&back).iter().filter(|name| *name == run).count();
    let counts = ["run001", "run002", "run003", "run004"].map(calls);
    assert!(counts == [1, 1, 2, 1], "{:?}", made(&back));
    // The jobs on the cluster, which the copy has left alone, end there.
    fs::write(cluster.join("permitted"), whole).unwrap();
    let (code, text) = quick::said(&mut resume(&cluster.join("run")));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(quick::results(&cluster.join("run")), results);
}
