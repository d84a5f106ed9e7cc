//! Cases of `lacuna coverage` and `lacuna power` in other processes and on a cluster.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::verb::study;
use crate::campaign::queue;
use crate::quick;
use crate::slurm::{Kind, started};

const PROCESSES: &str = "cases={ use = \"local\", processes = 2 }";
/// Chains of a few milliseconds.
const SHORT: &str = "sampler.steps=200";
/// Chains long enough for a process to be killed within one.
const LONG: &str = "sampler.steps=6000";

/// `lacuna coverage` of so many truths.
fn coverage(folder: &Path, out: &Path, count: usize, settings: &[&str]) -> Command {
    let mut command = quick::command();
    command.args(["coverage", "--threads", "2", "--count", &count.to_string(), "--out"]);
    command.arg(out).arg(folder.join("study.toml"));
    command.args(settings.iter().flat_map(|setting| ["--set", setting]));
    command
}

fn ends(command: &mut Command) {
    let (code, text) = quick::said(command);
    assert_eq!(code, Some(0), "{text}");
}

/// The error of a command that stops.
fn stops(command: &mut Command) -> String {
    let (code, text) = quick::said(command);
    assert_eq!(code, Some(1), "{text}");
    text
}

fn stage(out: &Path) -> PathBuf {
    out.join("7-coverage")
}

/// The cases and their count, byte for byte.
fn counted(out: &Path) -> [String; 2] {
    ["cases.json", "coverage.json"].map(|file| fs::read_to_string(stage(out).join(file)).unwrap())
}

/// The finished cases, in the order in which they ended.
fn log(out: &Path) -> Vec<String> {
    let text = fs::read_to_string(stage(out).join("cases.jsonl")).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

fn number_of(line: &str) -> u64 {
    let line: serde_json::Value = serde_json::from_str(line).unwrap();
    line["case"]["number"].as_u64().unwrap()
}

/// Number of the process that computes a case, once it has begun.
fn process(out: &Path, case: &str) -> Option<u64> {
    let text = fs::read_to_string(stage(out).join(format!("campaign/begun/{case}.json"))).ok()?;
    serde_json::from_str::<serde_json::Value>(&text).ok()?["process"].as_u64()
}

fn wait_for(what: &str, child: &mut Child, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(child.try_wait().unwrap().is_none(), "it ends before {what}");
        assert!(begun.elapsed() < Duration::from_secs(120), "{what} does not come");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn silent(command: &mut Command) -> Child {
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// On every route: through an emulator, with runs held out from several emulators, and with the model itself.
#[test]
fn processes_give_the_cases_that_threads_give() {
    let folder = study(0.5);
    let routes: [(&str, &[&str]); 3] =
        [("emulated", &[]), ("held-out", &["--from-runs"]), ("direct", &[])];
    for (route, arguments) in routes {
        let [here, there] = ["here", "there"].map(|name| folder.path().join(name).join(route));
        let mut settings = vec![SHORT];
        if route == "direct" {
            settings.extend(["surrogate=false", "design=false"]);
        }
        ends(coverage(folder.path(), &here, 5, &settings).args(arguments));
        settings.push(PROCESSES);
        ends(coverage(folder.path(), &there, 5, &settings).args(arguments));
        assert_eq!(counted(&there), counted(&here), "{route}");
        assert!(stage(&there).join("campaign/done/case00005.json").exists(), "{route}");
        assert!(!stage(&here).join("campaign").exists(), "{route}");
    }
    // More truths: those that are there are not computed again, wherever they were computed.
    let there = folder.path().join("there/emulated");
    let before = log(&there);
    ends(&mut coverage(folder.path(), &there, 8, &[SHORT, PROCESSES]));
    assert_eq!(log(&there)[..5], before);
    let here = folder.path().join("here/emulated");
    ends(&mut coverage(folder.path(), &here, 8, &[SHORT]));
    assert_eq!(counted(&there), counted(&here));
    // The cases are runs of a campaign, although no study was run in the directory.
    let output = quick::command().args(["campaign", "status"]).arg(&there).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("7-coverage: 8 runs, 8 done"), "{text}");
}

/// A process that is killed costs the case that it was computing; the same command computes that one, and no other.
#[test]
fn a_killed_process_costs_its_own_case() {
    let folder = study(0.5);
    let out = folder.path().join("out");
    let settings = [LONG, PROCESSES];
    let mut child = silent(&mut coverage(folder.path(), &out, 4, &settings));
    wait_for("the second case", &mut child, || process(&out, "case00002").is_some());
    let number = process(&out, "case00002").unwrap().to_string();
    assert!(Command::new("kill").args(["-9", &number]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(1));
    let before = log(&out);
    let mut numbers: Vec<u64> = before.iter().map(|line| number_of(line)).collect();
    numbers.sort_unstable();
    assert_eq!(numbers, [0, 2, 3], "the others are computed and kept");
    let output = quick::command().args(["campaign", "status"]).arg(&out).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("3 done, 1 failed"), "{text}");
    assert!(text.contains("case00002") && text.contains("ended by signal 9"), "{text}");
    ends(&mut coverage(folder.path(), &out, 4, &settings));
    let after = log(&out);
    assert_eq!((&after[..3], number_of(&after[3]), after.len()), (&before[..], 1, 4));
    let whole = folder.path().join("whole");
    ends(&mut coverage(folder.path(), &whole, 4, &[LONG]));
    assert_eq!(counted(&out), counted(&whole));
}

/// The process that asks is killed: what its processes had finished is not computed again.
#[test]
fn a_killed_count_goes_on_with_the_cases_it_has() {
    let folder = study(0.5);
    let [out, whole] = ["out", "whole"].map(|name| folder.path().join(name));
    let settings = [LONG, PROCESSES];
    let mut child = silent(&mut coverage(folder.path(), &out, 6, &settings));
    wait_for("the third case", &mut child, || process(&out, "case00003").is_some());
    child.kill().unwrap();
    child.wait().unwrap();
    let before = log(&out);
    assert!(before.len() < 6 && !stage(&out).join("cases.json").exists());
    ends(&mut coverage(folder.path(), &out, 6, &settings));
    let after = log(&out);
    assert_eq!((after.len(), &after[..before.len()]), (6, &before[..]));
    ends(&mut coverage(folder.path(), &whole, 6, &[LONG]));
    assert_eq!(counted(&out), counted(&whole));
}

/// A calibration that stops is counted as such, as with threads, and repeated when more truths are asked for.
#[test]
fn a_case_that_fails_is_told_and_repeated() {
    let folder = study(0.5);
    let outs = ["threads", "processes", "whole"].map(|name| folder.path().join(name));
    let settings: [&[&str]; 3] = [&[SHORT], &[SHORT, PROCESSES], &[SHORT]];
    for (out, settings) in outs.iter().zip(settings).take(2) {
        // A file where the folder of the third calibration belongs.
        let blocked = stage(out).join("cases/00003/5-calibrate");
        fs::create_dir_all(blocked.parent().unwrap()).unwrap();
        fs::write(&blocked, "").unwrap();
        ends(&mut coverage(folder.path(), out, 4, settings));
        let found: serde_json::Value = serde_json::from_str(&counted(out)[1]).unwrap();
        assert_eq!(found["tally"]["calibrated"], 3, "{found}");
        fs::remove_file(&blocked).unwrap();
    }
    let same = |out: &Path| counted(out)[0].replace(&*out.to_string_lossy(), "");
    assert_eq!(same(&outs[0]), same(&outs[1]));
    for (out, settings) in outs.iter().zip(settings) {
        ends(&mut coverage(folder.path(), out, 5, settings));
        assert_eq!(counted(out), counted(&outs[0]));
    }
}

/// A folder that cannot be made stops the count with the same words wherever it happens.
#[test]
fn a_case_that_cannot_be_computed_stops_the_count() {
    let folder = study(0.5);
    for settings in [&[SHORT][..], &[SHORT, PROCESSES]] {
        let out = folder.path().join(format!("out{}", settings.len()));
        let blocked = stage(&out).join("cases/00003");
        fs::create_dir_all(blocked.parent().unwrap()).unwrap();
        fs::write(&blocked, "").unwrap();
        let text = stops(&mut coverage(folder.path(), &out, 4, settings));
        assert!(text.contains("cannot write") && text.contains("cases/00003"), "{text}");
        fs::remove_file(&blocked).unwrap();
        ends(&mut coverage(folder.path(), &out, 4, settings));
    }
    assert_eq!(counted(&folder.path().join("out1")), counted(&folder.path().join("out2")));
}

/// A process that sees other files than the one that asked computes nothing.
#[test]
fn a_process_that_sees_something_else_says_so() {
    let folder = study(0.5);
    let out = folder.path().join("out");
    ends(&mut coverage(folder.path(), &out, 2, &[SHORT, PROCESSES]));
    let order = stage(&out).join("campaign/local");
    let work = || stops(quick::command().arg("work").arg(&order));
    let data = folder.path().join("line.csv");
    let text = fs::read_to_string(&data).unwrap();
    fs::write(&data, text.replacen("0.", "1.", 1)).unwrap();
    let said = work();
    assert!(said.contains("`3-read` is not finished"), "{said}");
    fs::write(&data, text).unwrap();
    assert_eq!(quick::said(quick::command().arg("work").arg(&order)).0, Some(0));
    let task = stage(&out).join("campaign/task.json");
    let text = fs::read_to_string(&task).unwrap();
    // Another number of steps is another study, whose finished stages are not there.
    fs::write(&task, text.replacen("steps = 200", "steps = 300", 1)).unwrap();
    let said = work();
    assert!(said.contains("is not finished") || said.contains("is not the same here"), "{said}");
    fs::write(&task, text.replacen("\"inputs\": \"", "\"inputs\": \"0", 1)).unwrap();
    let said = work();
    assert!(said.contains("are now those of another study"), "{said}");
}

/// `lacuna power` of a small study, 70 cases.
fn power(folder: &Path, out: &Path, settings: &[&str]) -> Command {
    let mut command = quick::command();
    command.args(["power", "--quick", "--threads", "2", "--out"]).arg(out);
    command.arg(folder.join("study.toml"));
    command.args(["--set", "gap.candidates=[\"gain\", \"offset\"]", "--set", SHORT]);
    command.args(settings.iter().flat_map(|setting| ["--set", setting]));
    command
}

#[test]
fn power_gives_the_same_rates_in_processes() {
    let folder = quick::tables();
    let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
    ends(&mut power(folder.path(), &here, &[]));
    // It is interrupted first.
    let cases = there.join("7-power/cases.jsonl");
    let log = || fs::read_to_string(&cases).unwrap_or_default();
    let mut child = silent(&mut power(folder.path(), &there, &[PROCESSES]));
    wait_for("the tenth case", &mut child, || log().lines().count() >= 10);
    child.kill().unwrap();
    child.wait().unwrap();
    let before = log();
    ends(&mut power(folder.path(), &there, &[PROCESSES]));
    assert!(log().starts_with(&before));
    let rates = |out: &Path| fs::read_to_string(out.join("7-power/power.json")).unwrap();
    assert_eq!(rates(&there), rates(&here));
    let sorted = |out: &Path| {
        let text = fs::read_to_string(out.join("7-power/cases.jsonl")).unwrap();
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines.sort();
        lines
    };
    assert_eq!(sorted(&there), sorted(&here));
}

/// Seven cases on a cluster, three a job: one array of three tasks. The process that asked is killed while they run.
#[test]
fn a_cluster_gives_the_cases_that_this_machine_gives() {
    let Some(slurm) = started(Kind::Plain) else { return };
    let folder = study(0.5);
    let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
    let executor = "cases={ use = \"slurm\", pack = 3, poll = 1, patience = 1 }";
    let mut command = coverage(folder.path(), &there, 7, &[LONG, executor]);
    command.env("SLURM_CONF", slurm.conf());
    let mut child = silent(&mut command);
    wait_for("the first case", &mut child, || process(&there, "case00001").is_some());
    child.kill().unwrap();
    child.wait().unwrap();
    ends(&mut command);
    ends(&mut coverage(folder.path(), &here, 7, &[LONG]));
    assert_eq!(counted(&there), counted(&here));
    let campaign = stage(&there).join("campaign");
    let script = fs::read_to_string(campaign.join("1/job.sh")).unwrap();
    assert!(script.contains("#SBATCH --array=0-2\n"), "{script}");
    assert!(!campaign.join("2").exists(), "nothing is submitted twice");
}

#[test]
fn a_queue_gives_the_cases_that_this_machine_gives() {
    let Some(server) = queue::started() else { return };
    let folder = study(0.5);
    let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
    let executor = format!("cases={{ use = \"hyperqueue\", pack = 2, {} }}", server.inline());
    ends(&mut coverage(folder.path(), &there, 5, &[SHORT, &executor]));
    ends(&mut coverage(folder.path(), &here, 5, &[SHORT]));
    assert_eq!(counted(&there), counted(&here));
}
