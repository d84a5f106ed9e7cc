//! Studies whose models are commands and Python functions, from an empty folder to their posteriors.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use std::{fs, thread};

use crate::quick::{self, replace};

/// Returns true if there is Python; `LACUNA_REQUIRE_PYTHON=1` makes its absence a failure.
pub fn there_is_python() -> bool {
    let there = std::process::Command::new("python3").arg("--version").output().is_ok();
    let required = std::env::var_os("LACUNA_REQUIRE_PYTHON").is_some_and(|value| value == "1");
    assert!(there || !required, "LACUNA_REQUIRE_PYTHON is set, and there is no `python3`");
    if !there {
        println!("skipped: there is no `python3`");
    }
    there
}

/// Runs a shipped study with few steps; its posterior must contain the truth given by its references.
fn finds_its_truth(study: &str, settings: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let path = quick::root().join("configs").join(study);
    quick::run(&path, settings, &out).unwrap_or_else(|stop| panic!("{stop}"));
    let summary = quick::summary(&out);
    for parameter in &quick::load(&path, settings).parameters {
        let found = &summary["parameters"][&parameter.name];
        let [mean, sd] = ["mean", "sd"].map(|key| found[key].as_f64().unwrap());
        let truth = parameter.reference.unwrap();
        assert!((mean - truth).abs() < 3.0 * sd, "{}: {mean} ± {sd}", parameter.name);
    }
}

#[test]
fn a_solver_that_is_driven_by_a_deck_finds_its_truth() {
    let vessel = quick::program("vessel");
    let command = format!("model.command=[\"{}\", \"deck.i\"]", vessel.display());
    let short = ["design.runs=60", "surrogate.validation=10", "sampler.steps=400"];
    finds_its_truth("external/study.toml", &[&[&*command], &short[..]].concat());
}

#[test]
fn a_python_function_finds_its_truth() {
    if there_is_python() {
        let short = ["design.runs=80", "surrogate.validation=10", "sampler.steps=400"];
        finds_its_truth("python/study.toml", &short);
    }
}

#[test]
fn a_study_for_abaqus_is_sound_but_for_the_command() {
    let path = quick::root().join("configs/abaqus/study.toml");
    let arguments = ["model.command=[\"abaqus-that-is-not-there\", \"job=beam\"]".to_owned()];
    let checked = lacuna_engine::study::resolve::load(&path, &arguments);
    let expected = "\
--set: there is no file `abaqus-that-is-not-there` in the folders of `PATH`: the command is not there
  |
  | model.command=[\"abaqus-that-is-not-there\", \"job=beam\"]
  |                ^^^^^^^^^^^^^^^^^^^^^^^^^^
  = help: install it, or write its path
";
    assert_eq!(checked.complaints(), expected);
}

/// A study with the inputs `a` and `b` and a line of five points as the response, without measurements.
const STUDY: &str = "\
[study]
name = \"line\"
title = \"A line\"

[[parameter]]
name = \"a\"
unit = \"1\"
prior = { uniform = [0.0, 1.0] }

[[parameter]]
name = \"b\"
unit = \"1\"
prior = { uniform = [0.0, 1.0] }

[response]
name = \"y\"
unit = \"1\"
axes = { time = { first = 1, last = 5, count = 5, unit = \"s\" } }

[model]
MODEL

[design]
use = \"sobol\"
runs = 32

[simulations]
use = \"netcdf\"

[surrogate]
use = \"polynomial_chaos\"
degree = 2
";

/// A folder with this study and some files.
fn line(model: &str, files: &[(&str, &str)]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("study.toml");
    fs::write(&study, STUDY.replace("MODEL", model)).unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    (folder, study)
}

const TABLE: &str = "\
time,y
1,{{ a }}
2,{{ b }}
3,{{ a | %.17g }}
4,1
5,2
";

#[test]
fn a_changed_template_makes_the_runs_again() {
    let model = "use = \"external\"\ncommand = [\"true\"]\n\
                 templates = [{ from = \"table.template\", to = \"y.csv\" }]\n\
                 output = { use = \"csv\", path = \"y.csv\" }";
    let (folder, study) = line(model, &[("table.template", TABLE)]);
    let out = folder.path().join("run");
    let made = || quick::run(&study, &[], &out).unwrap_or_else(|stop| panic!("{stop}")).made;
    assert_eq!(made()[..2], ["1-design", "2-simulate"]);
    let files = |run: &str| fs::read_dir(out.join("2-simulate").join(run)).unwrap().count();
    assert_eq!(files("run007"), 3, "the table, and what is printed");
    assert_eq!(made(), [""; 0]);
    replace(&folder.path().join("table.template"), "5,2", "5,3");
    assert_eq!(made()[0], "2-simulate");
}

#[test]
fn runs_that_fail_are_data() {
    if !there_is_python() {
        return;
    }
    let python = "\
import os
def simulate(a, b):
    if a > 0.9:
        raise ValueError('too steep')
    if b > 0.95:
        os._exit(1)
    return [a * t + b for t in range(5)]
";
    let model = "use = \"python\"\nfile = \"line.py\"";
    let (folder, study) = line(model, &[("line.py", python)]);
    let out = folder.path().join("run");
    let stopped = quick::run(&study, &[], &out).err().expect("the study stops").to_string();
    let reason = "`simulate` in `line.py`: ValueError: too steep, in line 4: `raise ValueError('too steep')`";
    assert!(stopped.contains(reason), "{stopped}");
    let text = fs::read_to_string(out.join("2-simulate/runs.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|row| row.split(',').collect()).collect();
    assert_eq!(rows.len(), 32);
    for row in &rows {
        let [a, b] = [row.len() - 2, row.len() - 1].map(|i| row[i].parse::<f64>().unwrap());
        assert_eq!(row[2] == "failed", a > 0.9 || b > 0.95, "{row:?}");
    }
    assert!(text.contains("the worker ended with exit code 1"), "{text}");
    let ran = quick::run(&study, &["simulations.allow_failed=0.5"], &out);
    assert!(ran.is_ok_and(|ran| ran.made.contains(&"4-surrogate".to_owned())));
    // A study without a reader of its runs says so in its design.
    replace(&study, "[simulations]\nuse = \"netcdf\"\n", "");
    let stopped = quick::run(&study, &[], &folder.path().join("strict")).err().unwrap();
    assert!(stopped.to_string().contains("`allow_failed` in `[design]`"), "{stopped}");
    let ran = quick::run(&study, &["design.allow_failed=0.5"], &folder.path().join("allowed"));
    assert!(ran.is_ok_and(|ran| ran.made.contains(&"4-surrogate".to_owned())));
}

/// Returns true if a process with this text in its command line is running.
fn running(text: &str) -> bool {
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    let mut commands = processes.map(|process| fs::read(process.path().join("cmdline")));
    commands.any(|command| String::from_utf8_lossy(&command.unwrap_or_default()).contains(text))
}

fn within(seconds: u64, mut is_so: impl FnMut() -> bool) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(seconds) {
        if is_so() {
            return true;
        }
        thread::sleep(Duration::from_millis(20));
    }
    false
}

/// Kills a running study; its model must have written a file `begun` and be identified by the study's folder.
fn leaves_nothing_behind(folder: &Path, study: &Path, mark: &str) {
    let mut command = quick::command();
    command.arg("run").arg(study).arg("--out").arg(folder.join("run"));
    let mut child = command.spawn().unwrap();
    assert!(within(60, || folder.join("begun").exists() && running(mark)));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(within(10, || !running(mark)), "`{mark}` runs on");
}

#[test]
#[cfg(target_os = "linux")]
fn a_killed_study_leaves_no_command_running() {
    let mark = format!("{}.25", 10_000 + std::process::id());
    let model = format!(
        "use = \"external\"\noutput = \"json\"\n\
         command = [\"sh\", \"-c\", \"touch {{{{ study }}}}/begun; sleep {mark} & sleep {mark}; echo {{{{ a }}}} {{{{ b }}}}\"]"
    );
    let (folder, study) = line(&model, &[]);
    leaves_nothing_behind(folder.path(), &study, &mark);
}

#[test]
#[cfg(target_os = "linux")]
fn a_killed_study_leaves_no_python_running() {
    if !there_is_python() {
        return;
    }
    let python = "\
import subprocess
def simulate(a, b):
    open('begun', 'w').close()
    subprocess.run(['sleep', 'MARK'])
";
    let mark = format!("{}.75", 10_000 + std::process::id());
    let python = python.replace("MARK", &mark);
    let (folder, study) = line("use = \"python\"\nfile = \"line.py\"", &[("line.py", &python)]);
    leaves_nothing_behind(folder.path(), &study, &mark);
}
