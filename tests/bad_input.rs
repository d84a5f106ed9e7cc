//! Bad input that is detected only when a study runs: the exact message, and no loss of results.
//!
//! Faults of a study itself are in `problems/`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use lacuna_plugins::readers::sierra::write::{History, Origin, write_history};
use lacuna_run::RunDirectory;
use tempfile::TempDir;

use crate::quick::{self, replace};

/// A message with the path of a folder removed.
fn without(folder: &Path, text: &str) -> String {
    text.replace(&folder.display().to_string(), "DIR")
}

/// Message with which a study stops.
fn stop(folder: &Path, settings: &[&str]) -> String {
    let stopped = quick::run(&folder.join("study.toml"), settings, &folder.join("run"));
    without(folder, &stopped.err().expect("the study stops").to_string())
}

/// Problems reported before a study runs.
fn complaints(folder: &Path, settings: &[&str]) -> String {
    let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
    let checked = lacuna_engine::study::resolve::load(&folder.join("study.toml"), &settings);
    assert!(checked.study.is_none(), "the study is accepted");
    without(folder, &checked.complaints())
}

/// Runs of the small study, made once.
fn runs() -> &'static Path {
    static RUNS: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = RUNS.get_or_init(|| {
        let folder = quick::simulated();
        let study = folder.path().join("study.toml");
        let settings = ["sampler.steps=2", "surrogate.degree=1", "validate.emulator_check=0"];
        quick::run(&study, &settings, &folder.path().join("run")).unwrap_or_else(|e| panic!("{e}"));
        let runs = folder.path().join("run/2-simulate");
        (folder, runs)
    });
    path
}

/// A study of finished runs: a table `runs/runs.csv`, and Exodus files beside it.
fn imported() -> TempDir {
    let folder = quick::simulated();
    let ours = folder.path().join("runs");
    fs::create_dir(&ours).unwrap();
    for entry in fs::read_dir(runs()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "h" || e == "csv") {
            fs::copy(&path, ours.join(path.file_name().unwrap())).unwrap();
        }
    }
    let study = folder.path().join("study.toml");
    let text = fs::read_to_string(&study).unwrap();
    let (head, rest) = text.split_once("[model]").unwrap();
    let (_, tail) = rest.split_once("[simulations]").unwrap();
    let text = format!("{head}[simulations]\nruns = \"runs/runs.csv\"\n{tail}");
    fs::write(&study, text.replace("emulator_check = 2", "emulator_check = 0")).unwrap();
    folder
}

const ALLOW_FAILED: &str =
    "help: `allow_failed` says how many runs may be left out, as a count or a fraction";

/// The message about failed runs of the imported study.
fn failed(count: usize, allowed: usize, named: &[(&str, &str)]) -> String {
    let named: String = named.iter().map(|(run, why)| format!("\n  `{run}`: {why}")).collect();
    format!(
        "DIR/runs/runs.csv: {count} of 40 runs cannot be used, and {allowed} may be left out:{named}\n{ALLOW_FAILED}"
    )
}

/// Truncates a file to its first half.
fn truncate(path: &Path) {
    let bytes = fs::read(path).unwrap();
    fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
}

#[test]
fn a_missing_file_is_found_before_anything_runs() {
    let folder = quick::tables();
    let found = complaints(folder.path(), &["measurements.path=\"measurd.csv\""]);
    let expected = "\
--set: there is no file `DIR/measurd.csv`
  |
  | measurements.path=\"measurd.csv\"
  |                   ^^^^^^^^^^^^^
";
    assert_eq!(found, expected);
    let folder = imported();
    fs::remove_file(folder.path().join("strain.csv")).unwrap();
    let expected = "\
DIR/study.toml:39:8: there is no file `DIR/strain.csv`
   |
39 | path = \"strain.csv\"
   |        ^^^^^^^^^^^^
";
    assert_eq!(complaints(folder.path(), &[]), expected);
}

#[test]
fn a_study_that_is_not_there_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let expected = "cannot read `DIR/study.toml`: there is no such file\n";
    assert_eq!(complaints(folder.path(), &[]), expected);
}

#[test]
fn a_truncated_run_is_named_and_left_out_only_when_allowed() {
    let folder = imported();
    truncate(&folder.path().join("runs/run007.h"));
    let reason = "DIR/runs/run007.h: is truncated or damaged: invalid data: classic header \
                  declares 20 records (3072 bytes) but the file has only 1536 bytes";
    let expected = failed(1, 0, &[("run007", reason)]);
    assert_eq!(stop(folder.path(), &[]), expected);
    let settings = ["simulations.allow_failed=1"];
    let out = folder.path().join("run");
    let ran = quick::run(&folder.path().join("study.toml"), &settings, &out);
    let ran = ran.unwrap_or_else(|stop| panic!("{stop}"));
    let left_out = without(folder.path(), &ran.warnings[0]);
    assert_eq!(left_out, format!("run run007 is left out: {reason}"));
    let summary = quick::summary(&out);
    assert_eq!([&summary["runs"]["used"], &summary["runs"]["failed"]], [39, 1]);
    assert!(summary["warnings"].to_string().contains("run run007 is left out"), "{summary}");
    assert!(summary["assessment"]["findings"].to_string().contains("failed_runs"), "{summary}");
}

#[test]
fn runs_that_the_table_calls_failed_count_as_failed() {
    let folder = imported();
    let table = folder.path().join("runs/runs.csv");
    replace(&table, "run003,run003.h,done,true,\"\"", "run003,,failed,false,\"the node died\"");
    replace(&table, "run005,run005.h,done,true,\"\"", "run005,,failed,false,\"\"");
    let both = [("run003", "the node died"), ("run005", "failed")];
    assert_eq!(stop(folder.path(), &[]), failed(2, 0, &both));
    assert_eq!(stop(folder.path(), &["simulations.allow_failed=1"]), failed(2, 1, &both));
    let settings = ["simulations.allow_failed=0.05"];
    let ran = quick::run(&folder.path().join("study.toml"), &settings, &folder.path().join("run"));
    let warnings = ["run run003 is left out: the node died", "run run005 is left out: failed"];
    assert_eq!(ran.unwrap_or_else(|stop| panic!("{stop}")).warnings[..2], warnings);
}

#[test]
fn a_sensor_missing_from_a_run_is_named() {
    let folder = imported();
    let times: Vec<f64> = (1..=20).map(|i| f64::from(i) * 1e-5).collect();
    let names = ["strain_B", "strain_C"].map(str::to_owned).to_vec();
    let values = vec![times.clone(); 2];
    let history = History { times, names, values };
    let file = folder.path().join("runs/run011.h");
    write_history(&file, &Origin::default(), &history).unwrap();
    let reason = "DIR/runs/run011.h: has no variable `strain_U`; it has `strain_B`, `strain_C`";
    assert_eq!(stop(folder.path(), &[]), failed(1, 0, &[("run011", reason)]));
}

#[test]
fn a_run_that_ends_too_early_is_named() {
    let folder = imported();
    let longer = "response.axes.time.last=3e-4";
    // Measurements as short as the runs would be rejected first.
    let without = ["measurements=false", "discrepancy=false", "sampler=false", "validate=false"];
    let settings = [&[longer, "response.axes.time.count=30"][..], &without].concat();
    let found = stop(folder.path(), &settings);
    let reason = |run: usize| {
        format!(
            "DIR/runs/run{run:03}.h, sensor `B`, variable `strain_B`: times go from 1e-5 to 2e-4 and do not \
             cover the response's 1e-5 to 3e-4: an unfinished run?"
        )
    };
    let runs: Vec<(String, String)> =
        (1..=10).map(|run| (format!("run{run:03}"), reason(run))).collect();
    let named: Vec<(&str, &str)> = runs.iter().map(|(run, why)| (&run[..], &why[..])).collect();
    let expected = failed(40, 0, &named).replace("\nhelp", "\n  and 30 more\nhelp");
    assert_eq!(found, expected);
}

#[test]
fn measurements_off_the_time_axis_are_refused() {
    let folder = imported();
    let data = folder.path().join("strain.csv");
    replace(&data, "\n1,B,0.00002,", "\n1,B,0.000025,");
    let expected = "DIR/strain.csv, line 3, column 3 (`time`): time 0.000025 s is not on the response's \
                    axis of 20 values from 0.00001 to 0.0002 s";
    assert_eq!(stop(folder.path(), &[]), expected);
}

#[test]
fn numbers_that_are_none_are_refused_in_measurements() {
    let folder = quick::tables();
    let data = folder.path().join("measured.csv");
    let text = fs::read_to_string(&data).unwrap();
    let with = |value: &str| {
        let line = text.lines().nth(3).unwrap();
        let (rest, _) = line.rsplit_once(',').unwrap();
        fs::write(&data, text.replace(line, &format!("{rest},{value}"))).unwrap();
    };
    let place = "DIR/measured.csv, line 4, column 3 (`displacement`)";
    with("inf");
    let expected = format!("{place}: expected a finite number or a blank, found `inf`");
    assert_eq!(stop(folder.path(), &[]), expected);
    with("lost");
    let expected = format!("{place}: expected a number, found `lost`");
    assert_eq!(stop(folder.path(), &[]), expected);
    // A blank or NaN is a missing value: it is counted as missing, not as a number.
    let count = |value: &str| {
        with(value);
        let out = folder.path().join("run");
        let ran = quick::run(&folder.path().join("study.toml"), &["sampler.steps=2"], &out);
        ran.unwrap_or_else(|stop| panic!("{stop}"));
        quick::summary(&out)["data"]["count"].as_u64().unwrap()
    };
    let all = text.lines().count() as u64 - 1;
    assert_eq!((count("0.5"), count("NaN"), count("")), (all, all - 1, all - 1));
}

#[test]
fn numbers_that_are_none_make_a_run_fail() {
    let folder = quick::tables();
    let data = folder.path().join("responses.csv");
    let text = fs::read_to_string(&data).unwrap();
    for (value, reason) in [
        ("NaN", "1 of 20 values are missing, first at time 0.25 s"),
        ("inf", "the response is inf at time 0.25 s"),
    ] {
        let line = text.lines().nth(25).unwrap();
        let (rest, _) = line.rsplit_once(',').unwrap();
        fs::write(&data, text.replace(line, &format!("{rest},{value}"))).unwrap();
        let expected = format!(
            "DIR/runs.csv: 1 of 80 runs cannot be used, and 0 may be left out:\n  `r02`: DIR/responses.csv: {reason}\n{ALLOW_FAILED}"
        );
        assert_eq!(stop(folder.path(), &[]), expected);
    }
}

#[test]
fn more_terms_than_runs_are_refused() {
    let folder = quick::tables();
    let expected = "\
`surrogate.degree`: least squares of degree 12 has 91 terms, but there are only 64 runs
help: the largest degree that fits is 9; `solver = \"least_angle_regression\"` can choose among more \
terms than runs";
    assert_eq!(stop(folder.path(), &["surrogate.solver=\"least_squares\""]), expected);
    let folder = quick::simulated();
    let settings = ["surrogate.solver=\"least_squares\"", "surrogate.degree=5"];
    let expected = "\
--set: least squares of degree 5 has 56 terms, but there are only 32 runs
  |
  | surrogate.degree=5
  |                  ^
  = help: the largest degree that fits is 3; `solver = \"least_angle_regression\"` can choose among more \
terms than runs
";
    assert_eq!(complaints(folder.path(), &settings), expected);
}

#[test]
fn a_full_disk_loses_nothing() {
    let folder = quick::simulated();
    let disk = folder.path().join("disk");
    fs::create_dir(&disk).unwrap();
    let mount = |options: &str| {
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", options, "tmpfs"]).arg(&disk);
        mount.output().is_ok_and(|output| output.status.success())
    };
    if !mount("size=160k") {
        println!("skipped: a small file system cannot be mounted (not root?)");
        return;
    }
    let _mounted = Mounted(disk.clone());
    let out = disk.join("run");
    let study = folder.path().join("study.toml");
    let full = quick::run(&study, &[], &out).err().expect("the disk is full").to_string();
    let lines: Vec<&str> = full.lines().collect();
    assert_eq!(lines.len(), 3, "{full}");
    assert!(lines[0].starts_with(&format!("cannot write {}/2-simulate/", out.display())), "{full}");
    assert!(lines[0].ends_with(": no space left on device"), "{full}");
    let help = "help: free some space and run the same command again: finished work is kept";
    assert!(lines.contains(&help), "{full}");
    let saved = lines.iter().find_map(|line| line.strip_prefix("saved: ")).unwrap();
    let (kept, folder_of_runs) = saved.split_once(" of 40 runs in ").unwrap();
    assert_eq!(folder_of_runs, out.join("2-simulate").display().to_string());
    assert!((1..40).contains(&kept.parse::<usize>().unwrap()), "{full}");
    assert!(mount("remount,size=60m"));
    let ran = quick::run(&study, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    assert_eq!(ran.made[0], "2-simulate");
    let whole = folder.path().join("whole");
    quick::run(&study, &[], &whole).unwrap_or_else(|stop| panic!("{stop}"));
    assert_eq!(quick::results(&out), quick::results(&whole));
}

/// A file system that is unmounted when the test ends.
struct Mounted(PathBuf);

impl Drop for Mounted {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

/// Flips one bit in the middle of a file.
fn flip(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_damaged_artifact_is_made_again_with_a_warning() {
    let folder = quick::simulated();
    let out = folder.path().join("run");
    let run = || {
        let ran = quick::run(&folder.path().join("study.toml"), &[], &out);
        ran.unwrap_or_else(|stop| panic!("{stop}"))
    };
    run();
    let sound = quick::results(&out);
    for (file, stages, warning) in [
        (
            "4-surrogate/emulator.bin",
            &["4-surrogate"][..],
            "DIR/4-surrogate/emulator.bin is missing or has changed; the stage is repeated",
        ),
        (
            "5-calibrate/draws.nc",
            &["5-calibrate"],
            "DIR/5-calibrate/draws.nc is missing or has changed; the stage is repeated",
        ),
        (
            "2-simulate/run004.h",
            &["2-simulate"],
            "result files in DIR/2-simulate are missing or have changed (1 of 40); the runs are repeated",
        ),
    ] {
        flip(&out.join(file));
        let ran = run();
        assert_eq!(ran.made, stages, "{file}");
        let warnings: Vec<String> = ran.warnings.iter().map(|w| without(&out, w)).collect();
        assert_eq!(warnings[0], warning);
        assert_eq!(quick::results(&out), sound, "{file}");
    }
}

#[test]
fn a_run_directory_belongs_to_one_process() {
    let folder = quick::tables();
    let out = folder.path().join("run");
    let _held = RunDirectory::open(&out).unwrap();
    let mut command = quick::command();
    command.arg("run").arg(folder.path().join("study.toml")).arg("--out").arg(&out);
    let (code, text) = quick::said(&mut command);
    let expected = "\
error: another process is working in DIR/run
help: wait for it, or choose another folder with `--out DIR`
";
    assert_eq!((code, &without(folder.path(), &text)[..]), (Some(1), expected));
}

#[test]
fn a_folder_that_is_no_run_directory_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for verb in ["resume", "report"] {
        let (code, text) = quick::said(quick::command().arg(verb).arg(folder.path()));
        let expected = "error: DIR is no run directory: it has no resolved.toml\n";
        assert_eq!((code, &without(folder.path(), &text)[..]), (Some(2), expected));
    }
    // The folder is unchanged.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_wrong_study_makes_no_run_directory() {
    let folder = quick::tables();
    let out = folder.path().join("run");
    let mut command = quick::command();
    command.arg("run").arg(folder.path().join("study.toml")).arg("--out").arg(&out);
    let (code, text) = quick::said(command.args(["--set", "sampler.steps=many"]));
    let expected = "\
--set: wrong value for `steps`
  |
  | sampler.steps=many
  |               ^^^^
  = expected a whole number, found \"many\"

1 problem in DIR/study.toml
";
    assert_eq!((code, &without(folder.path(), &text)[..]), (Some(2), expected));
    assert!(!out.exists());
}
