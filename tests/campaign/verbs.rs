//! The commands `lacuna campaign …`.

use std::fs;
use std::path::Path;
use std::process::Command;

use lacuna::run::files;

use super::{outcomes, run, study};
use crate::quick;

pub(super) fn campaign(words: &[&str], out: &Path) -> Command {
    let mut command = quick::command();
    command.arg("campaign").arg(words[0]).arg(out).args(&words[1..]);
    command
}

/// Output of a command that must succeed.
pub(super) fn printed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Names of the runs that were made, one entry per call of the model.
pub(super) fn made(folder: &Path) -> Vec<String> {
    let text = fs::read_to_string(folder.join("made")).unwrap_or_default();
    let mut runs: Vec<String> = text.lines().map(str::to_owned).collect();
    runs.sort();
    runs
}

const COUNTED: &str = "echo $1 >> \"$3/made\"
[ $1 = run002 ] && [ ! -e \"$3/mended\" ] && { echo 'no convergence' >&2; exit 3; }
echo \"[$2]\"";

#[test]
fn only_what_failed_is_made_again() {
    let (folder, path) = study(COUNTED, "use = \"local\"\nprocesses = 1");
    let out = folder.path().join("run");
    assert_eq!(quick::said(&mut run(&path, &out, &[])).0, Some(1));
    let table = printed(&mut campaign(&["status"], &out));
    assert!(
        table.starts_with("2-simulate: 6 runs, 5 done, 1 failed\n  run002     failed"),
        "{table}"
    );
    assert!(table.contains("no convergence"), "{table}");
    let json = printed(&mut campaign(&["status", "--json"], &out));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["runs"][1]["state"], "failed");
    let (code, text) = quick::said(&mut campaign(&["retry"], &out));
    assert_eq!(code, Some(1));
    assert!(text.contains("1 run has failed again"), "{text}");
    fs::write(folder.path().join("mended"), "").unwrap();
    assert!(printed(&mut campaign(&["retry"], &out)).contains("all runs are done"));
    let twice = ["run001", "run002", "run002", "run002", "run003", "run004", "run005", "run006"];
    assert_eq!(made(folder.path()), twice);
    assert_eq!(printed(&mut campaign(&["status"], &out)), "2-simulate: 6 runs, 6 done\n");
}

/// Points of the runs by name, as in the table.
fn points(out: &Path) -> Vec<(String, String)> {
    let text = fs::read_to_string(out.join("2-simulate/runs.csv")).unwrap();
    let cells = text.lines().skip(1).map(|line| {
        (line.split(',').next().unwrap().to_owned(), line.rsplit(',').next().unwrap().to_owned())
    });
    cells.collect()
}

#[test]
fn a_design_grows_and_no_run_is_made_twice() {
    let (folder, path) = study(COUNTED, "use = \"local\"");
    fs::write(folder.path().join("mended"), "").unwrap();
    let out = folder.path().join("run");
    let (code, text) = quick::said(&mut run(&path, &out, &[]));
    assert_eq!(code, Some(0), "{text}");
    let before = points(&out);
    let said = printed(&mut campaign(&["extend", "--runs", "4"], &out));
    assert!(said.contains("10 runs in all") && said.contains("extended = [4]"), "{said}");
    let status = printed(&mut campaign(&["status"], &out));
    assert!(status.contains("2-simulate: 10 runs, 6 done, 4 missing"), "{status}");
    assert!(status.contains("added to the design, not begun"), "{status}");
    let (code, text) = quick::said(quick::command().arg("resume").arg(&out));
    assert_eq!(code, Some(0), "{text}");
    let after = points(&out);
    assert_eq!(after[..6], before);
    assert_eq!(made(folder.path()).len(), 10, "{:?}", made(folder.path()));
    // Stated in the study instead, the runs are the same.
    let (code, text) = quick::said(&mut run(&path, &out, &["design.extended=[4]"]));
    assert_eq!((code, made(folder.path()).len()), (Some(0), 10), "{text}");
    // Without it the first results are restored.
    let (code, text) = quick::said(&mut run(&path, &out, &[]));
    assert_eq!((code, made(folder.path()).len()), (Some(0), 10), "{text}");
    assert_eq!(points(&out), before);
}

#[test]
fn runs_made_by_hand_are_taken_in() {
    let (folder, path) = study(COUNTED, "use = \"local\"");
    fs::write(folder.path().join("mended"), "").unwrap();
    let out = folder.path().join("run");
    assert_eq!(quick::said(&mut run(&path, &out, &[])).0, Some(0));
    let hand = folder.path().join("hand");
    fs::create_dir_all(&hand).unwrap();
    fs::write(hand.join("first.csv"), "place,y\nhere,0.25\n").unwrap();
    fs::write(hand.join("second.csv"), "place,y\nhere,0.75\n").unwrap();
    let table = hand.join("runs.csv");
    let import = |out: &Path| {
        let table = table.display().to_string();
        campaign(&["import", &table, "--reader", "csv"], out)
    };
    for (text, complaint) in [
        ("run,file\nx,first.csv\n", "there is no column for the parameter `a`"),
        ("run,a,file\nx,low,first.csv\n", "line 2: expected a number for `a`, found `low`"),
        ("run,a,file\nx,0.25,third.csv\n", "third.csv"),
        ("run,a [m],file\nx,0.25,first.csv\n", "`m` does not convert"),
        ("run,a,file\nrun001,0.25,first.csv\n", "runs.csv: there is a run `run001` already"),
        ("run,a,file\nx,1e300,first.csv\n", "`a` is 1e300, and its design reaches from 0 to 1"),
    ] {
        fs::write(&table, text).unwrap();
        let (code, said) = quick::said(&mut import(&out));
        assert_eq!(code, Some(1), "{text}");
        assert!(said.contains(complaint), "{said}");
        assert!(!out.join("imports/1").exists());
    }
    fs::write(&table, "run,a,file\nby-hand-1,0.25,first.csv\nby-hand-2,0.75,second.csv\n").unwrap();
    let said = printed(&mut import(&out));
    assert!(said.starts_with("2 runs imported into"), "{said}");
    let status = printed(&mut campaign(&["status"], &out));
    assert!(status.contains("2-simulate: 8 runs, 8 done"), "{status}");
    let (code, said) = quick::said(&mut import(&out));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("there is a run `by-hand-1` already"), "{said}");
    assert!(!out.join("imports/2").exists());
    let (code, text) = quick::said(quick::command().arg("resume").arg(&out));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(made(folder.path()).len(), 6, "no run is made again");
    let all = outcomes(&out);
    assert_eq!(all.len(), 8);
    assert_eq!(all[6], ("by-hand-1".to_owned(), String::new()));
    assert_eq!(quick::summary(&out)["runs"]["used"], 8);
    // A file that was changed afterwards is not the one that was imported.
    fs::remove_dir_all(out.join("2-simulate")).unwrap();
    fs::write(out.join("imports/1/by-hand-2.nc"), "other").unwrap();
    let (code, text) = quick::said(quick::command().arg("resume").arg(&out));
    assert_eq!(code, Some(1));
    assert!(text.contains("by-hand-2.nc is not as it was imported"), "{text}");
}

#[test]
fn edits_in_a_run_directory_are_told_and_the_manifest_names_what_ran() {
    let (folder, path) = study(COUNTED, "use = \"local\"");
    fs::write(folder.path().join("mended"), "").unwrap();
    let out = folder.path().join("run");
    assert_eq!(quick::said(&mut run(&path, &out, &[])).0, Some(0));
    let (resolved, record) = (out.join("resolved.toml"), out.join("resolved.sha256"));
    let written = files::hash_file(&path).unwrap();
    let manifest_is_true = || {
        let manifest: serde_json::Value = files::read_json(&out.join("manifest.json")).unwrap();
        assert_eq!(manifest["study_sha256"], written);
        assert_eq!(manifest["resolved_sha256"], files::hash_file(&resolved).unwrap());
    };
    manifest_is_true();
    let resume = || quick::said(quick::command().arg("resume").arg(&out));
    let status = || quick::said(&mut campaign(&["status"], &out));
    let of_copy = "study.toml has been changed since the run began";
    let of_resolved = "resolved.toml has been changed since Lacuna wrote it";

    quick::replace(&out.join("study.toml"), "seed = 3", "seed = 4");
    let (code, text) = resume();
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains(of_copy) && !text.contains(of_resolved), "{text}");
    manifest_is_true();

    quick::replace(&resolved, "runs = 6", "runs = 5");
    assert!(status().1.contains(of_resolved), "{}", status().1);
    // Run directories of earlier versions have no record.
    let recorded = fs::read(&record).unwrap();
    fs::remove_file(&record).unwrap();
    let (code, text) = status();
    assert!(code == Some(0) && !text.contains(of_resolved), "{text}");
    fs::write(&record, recorded).unwrap();
    // An extension does not hide the edit.
    printed(&mut campaign(&["extend", "--runs", "1"], &out));
    let (code, text) = resume();
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains(of_resolved), "{text}");
    manifest_is_true();
    assert!(!status().1.contains(of_resolved), "{}", status().1);
}
