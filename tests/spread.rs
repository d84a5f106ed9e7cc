//! Searches of a surrogate in other processes and on a cluster: the emulator has the bits that threads give.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::quick;
use crate::slurm::{Kind, started};

const STUDY: &str = r#"
[study]
title = "waves"
seed = 5

[[parameter]]
name = "a"
prior = { uniform = [0.5, 1.5] }

[[parameter]]
name = "b"
prior = { uniform = [0.2, 0.8] }

[response]
name = "y"
unit = "m"
axes = { t = { first = 0.0, last = 0.5, count = OUTPUTS, unit = "s" } }

[model]
use = "equations"
where = { x = "t / (1 {s})" }
observe = "(a * exp(-b * x) * sin(6 * x) + b * cos(2 * x) / (1 + a * x)) * (1 {m})"

[design]
use = "latin_hypercube"
runs = RUNS

[surrogate]
validation = 5
SURROGATE
"#;

/// A Gaussian process for each output.
const PROCESSES: &str = "use = \"gaussian_process\"\ncomponents = \"none\"";

/// A study without measurements, which ends with its emulator.
fn study(runs: usize, outputs: usize, surrogate: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = STUDY.replace("RUNS", &runs.to_string()).replace("OUTPUTS", &outputs.to_string());
    fs::write(folder.path().join("study.toml"), text.replace("SURROGATE", surrogate)).unwrap();
    folder
}

fn run(folder: &Path, out: &Path, cases: Option<&str>) -> Command {
    let mut command = quick::command();
    command.args(["run", "--threads", "2", "--out"]).arg(out).arg(folder.join("study.toml"));
    let setting = cases.map(|options| format!("cases={{ of = [\"surrogate\"], {options} }}"));
    command.args(setting.iter().flat_map(|setting| ["--set", setting]));
    command
}

fn ends(command: &mut Command) {
    let (code, text) = quick::said(command);
    assert_eq!(code, Some(0), "{text}");
}

/// Asserts that two runs have the same files. The list of the cases that were asked for, and the name of the executor in the
/// summary, belong to one of them alone.
fn assert_same(there: &Path, here: &Path, what: &str) {
    let of = |out: &Path| {
        let mut files = quick::results(out);
        files.remove("4-surrogate/asked.json");
        let summary = files.get_mut("summary.json").unwrap();
        for executor in ["local", "slurm"] {
            *summary = summary.replace(&format!(",\"cases\":\"{executor}\""), "");
        }
        files
    };
    let (there, here) = (of(there), of(here));
    assert!(here.contains_key("4-surrogate/emulator.bin"), "{what}");
    assert!(there.keys().eq(here.keys()), "{what}: {:?} {:?}", there.keys(), here.keys());
    let others: Vec<&String> = here.keys().filter(|file| here[*file] != there[*file]).collect();
    assert!(others.is_empty(), "{what}: {others:?}");
}

fn campaign(out: &Path) -> PathBuf {
    out.join("4-surrogate/campaign")
}

fn outcomes(out: &Path) -> Vec<PathBuf> {
    let Ok(files) = fs::read_dir(campaign(out).join("outcomes")) else { return Vec::new() };
    let mut files: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "json"));
    files.sort();
    files
}

/// Expansions of every output, and of components, which are chosen in several calls; processes of outputs and of components;
/// both together. Other solvers and the default of `[cases]` search in the process that was started.
#[test]
fn processes_give_the_emulator_that_threads_give() {
    let kinds: [(&str, usize, &str); 6] = [
        ("expansions", 7, "use = \"polynomial_chaos\""),
        ("components", 1200, "use = \"polynomial_chaos\""),
        ("processes", 6, PROCESSES),
        ("few processes", 30, "use = \"gaussian_process\"\ncomponents = { count = 3 }"),
        ("both", 4, "use = \"polynomial_chaos_kriging\""),
        ("greedy", 4, "use = \"polynomial_chaos\"\nsolver = \"orthogonal_matching_pursuit\""),
    ];
    for (name, outputs, surrogate) in kinds {
        let folder = study(45, outputs, surrogate);
        let [here, there, by_default] =
            ["here", "there", "default"].map(|name| folder.path().join(name));
        ends(&mut run(folder.path(), &here, None));
        ends(&mut run(folder.path(), &there, Some("use = \"local\", processes = 2")));
        assert_same(&there, &here, name);
        assert_eq!(outcomes(&there).is_empty(), name == "greedy", "{name}");
        assert!(!campaign(&here).exists(), "{name}");
        if name == "processes" {
            let output =
                quick::command().args(["campaign", "status"]).arg(&there).output().unwrap();
            let text = String::from_utf8(output.stdout).unwrap();
            assert!(text.contains("4-surrogate: 6 runs, 6 done"), "{text}");
            let mut command = run(folder.path(), &by_default, None);
            ends(command.args(["--set", "cases={ use = \"local\", processes = 2 }"]));
            assert!(!campaign(&by_default).exists());
        }
    }
}

/// Starts a command, kills it as soon as a case has its outcome, and returns the outcomes that are there then.
fn killed(command: &mut Command, out: &Path) -> Vec<PathBuf> {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while outcomes(out).is_empty() {
        assert!(child.try_wait().unwrap().is_none(), "it ends before its first case");
        assert!(begun.elapsed() < Duration::from_secs(120), "no case ends");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    outcomes(out)
}

/// The process that was started is killed: what its processes had found is not searched again.
#[test]
fn a_killed_fit_goes_on_with_the_cases_it_has() {
    let folder = study(150, 12, PROCESSES);
    let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
    let executor = "use = \"local\", processes = 1";
    let found = killed(&mut run(folder.path(), &there, Some(executor)), &there);
    assert!(found.len() < 12, "{found:?}");
    let made = |file: &PathBuf| fs::metadata(file).unwrap().modified().unwrap();
    let before: Vec<_> = found.iter().map(made).collect();
    ends(&mut run(folder.path(), &there, Some(executor)));
    assert_eq!(found.iter().map(made).collect::<Vec<_>>(), before);
    ends(&mut run(folder.path(), &here, None));
    assert_same(&there, &here, "resumed");
    // Another seed of the design is another fit: no case of the first is used.
    for (out, cases) in [(&here, None), (&there, Some(executor))] {
        ends(run(folder.path(), out, cases).args(["--set", "study.seed=6"]));
    }
    assert_same(&there, &here, "another seed");
}

/// A process that is killed costs the search that it was making: it is told with its reason, and the same command makes that
/// one again.
#[test]
fn a_killed_process_costs_its_own_search() {
    let folder = study(1000, 12, PROCESSES);
    let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
    let executor = "use = \"local\", processes = 2";
    let mut command = run(folder.path(), &there, Some(executor));
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let begun = campaign(&there).join("begun/case00001.json");
    let process = || {
        let record: Value = serde_json::from_str(&fs::read_to_string(&begun).ok()?).ok()?;
        record["process"].as_u64()
    };
    let since = Instant::now();
    while process().is_none() {
        assert!(since.elapsed() < Duration::from_secs(120), "no case begins");
        std::thread::sleep(Duration::from_millis(5));
    }
    let number = process().unwrap().to_string();
    assert!(Command::new("kill").args(["-9", &number]).status().unwrap().success());
    let ended = child.wait_with_output().unwrap();
    let text = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(1), "{text}");
    assert!(text.contains("1 of 12 cases have no outcome; `case00001`"), "{text}");
    assert!(text.contains("ended by signal 9") && outcomes(&there).len() == 11, "{text}");
    ends(&mut run(folder.path(), &there, Some(executor)));
    ends(&mut run(folder.path(), &here, None));
    assert_same(&there, &here, "after a kill");
}

/// Twelve searches on a cluster, three a job: one array of four tasks. The process that asked is killed while they run.
#[test]
fn a_cluster_gives_the_emulator_that_this_machine_gives() {
    let Some(slurm) = started(Kind::Plain) else { return };
    let folder = study(150, 12, PROCESSES);
    let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
    let executor = "use = \"slurm\", pack = 3, poll = 1, patience = 1";
    let mut command = run(folder.path(), &there, Some(executor));
    command.env("SLURM_CONF", slurm.conf());
    killed(&mut command, &there);
    let mut again = run(folder.path(), &there, Some(executor));
    ends(again.env("SLURM_CONF", slurm.conf()));
    ends(&mut run(folder.path(), &here, None));
    assert_same(&there, &here, "cluster");
    let script = fs::read_to_string(campaign(&there).join("1/job.sh")).unwrap();
    assert!(script.contains("#SBATCH --array=0-3\n"), "{script}");
    assert!(!campaign(&there).join("2").exists(), "nothing is submitted twice");
}
