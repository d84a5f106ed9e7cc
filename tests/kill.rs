//! A killed study continues where it stopped, and ends with the bits of an uninterrupted run.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::quick;

/// Slow enough to be killed in progress: runs of several milliseconds one after the other, and a sampler that writes
/// its state (first after a tenth of a second) before it ends.
const SETTINGS: [&str; 5] = [
    "model.numerics.mesh=\"default\"",
    "sampler.walkers=60",
    "sampler.steps=9000",
    "surrogate.degree=3",
    "validate.emulator_check=0",
];

fn start(folder: &Path, out: &Path) -> Command {
    let mut command = quick::command();
    command.args(["run", "--threads", "1", "--out"]).arg(out).arg(folder.join("study.toml"));
    command.args(SETTINGS.iter().flat_map(|setting| ["--set", setting]));
    command
}

fn resume(out: &Path) -> Command {
    let mut command = quick::command();
    command.args(["resume", "--threads", "1"]).arg(out);
    command
}

/// Starts a command and sends it SIGKILL as soon as `now` returns true.
fn kill_when(command: &mut Command, now: impl Fn() -> bool) {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let begun = Instant::now();
    while !now() {
        if let Some(status) = child.try_wait().unwrap() {
            let output = child.wait_with_output().unwrap();
            panic!(
                "ended before it could be killed: {status}\n{}",
                String::from_utf8_lossy(&output.stderr)
            );
        }
        assert!(begun.elapsed() < Duration::from_secs(120), "the moment does not come");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success());
}

fn lines(path: &Path) -> usize {
    fs::read_to_string(path).map_or(0, |text| text.lines().count())
}

/// Number of steps at which the state of the sampler was last written.
fn step(calibrate: &Path) -> u64 {
    let text = fs::read_to_string(calibrate.join("state.json")).unwrap_or_default();
    let state: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    state["step"].as_u64().unwrap_or(0)
}

#[test]
fn a_killed_study_ends_with_the_bits_it_would_have_had() {
    let folder = quick::simulated();
    let (whole, broken) = (folder.path().join("whole"), folder.path().join("broken"));

    let log = broken.join("2-simulate/progress.jsonl");
    kill_when(&mut start(folder.path(), &broken), || lines(&log) >= 3);
    assert!(lines(&log) < 40 && !broken.join("3-read").exists());
    kill_when(&mut resume(&broken), || lines(&log) >= 20);
    assert!(lines(&log) < 40 && !broken.join("3-read").exists());
    let first_run = fs::metadata(broken.join("2-simulate/run001.h")).unwrap().modified().unwrap();

    let calibrate = broken.join("5-calibrate");
    let drawn = || fs::metadata(calibrate.join("draws.bin")).map_or(0, |m| m.len());
    kill_when(&mut resume(&broken), || drawn() > 0);
    assert!(!calibrate.join("stage.json").exists());
    // A checkpoint that one attempt writes is where the next one continues.
    let before = step(&calibrate);
    kill_when(&mut resume(&broken), || step(&calibrate) > before);
    assert!(!calibrate.join("stage.json").exists());

    let (code, text) = quick::said(&mut resume(&broken));
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = quick::said(&mut start(folder.path(), &whole));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(quick::results(&broken), quick::results(&whole));
    // Nothing was lost: the first run is the one made before the first kill.
    let kept = fs::metadata(broken.join("2-simulate/run001.h")).unwrap().modified().unwrap();
    assert_eq!(kept, first_run);
}

/// An oscillation of 38 periods without an emulator: the evidence needs 2200 solutions of about a millisecond.
fn oscillation(folder: &Path) {
    let parameter = "name = \"w\"\nunit = \"1/s\"\nprior = { uniform = [2.01, 2.03] }";
    let model = "state = { x = { start = \"1 {m}\", unit = \"m\" }, v = { start = \"0 {m/s}\", unit = \"m/s\" } }\n\
                 rate = { x = \"v\", v = \"-w^2 * x\" }\nobserve = \"x\"\n\
                 solver = { relative_tolerance = 1e-10 }";
    let sampler = "use = \"affine_invariant_ensemble\"\nwalkers = 8\nsteps = 120";
    quick::oscillation(folder, [parameter, model, sampler], (300, 120.0), |t| (2.02 * t).cos());
}

#[test]
fn a_killed_evidence_goes_on_with_the_pieces_it_has() {
    let folder = tempfile::tempdir().unwrap();
    oscillation(folder.path());
    let (whole, broken) = (folder.path().join("whole"), folder.path().join("broken"));
    let run = |out: &Path| {
        let mut command = quick::command();
        command.args(["run", "--threads", "1", "--out"]).arg(out);
        command.arg(folder.path().join("study.toml"));
        command
    };
    let pieces = broken.join("6-evidence/pieces.bin");
    let size = || fs::metadata(&pieces).map_or(0, |file| file.len());
    kill_when(&mut run(&broken), || size() > 0);
    assert!(!broken.join("6-evidence/stage.json").exists());

    let (code, text) = quick::said(&mut resume(&broken));
    assert_eq!(code, Some(0), "{text}");
    assert!(!pieces.exists());
    let (code, text) = quick::said(&mut run(&whole));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(quick::results(&broken), quick::results(&whole));
}

/// Power analysis of a small study, 70 cases.
fn power(folder: &Path, out: &Path) -> Command {
    let mut command = quick::command();
    command.args(["power", "--quick", "--threads", "1", "--out"]).arg(out);
    command.arg(folder.join("study.toml"));
    command.args(["--set", "gap.candidates=[\"gain\", \"offset\"]", "--set", "sampler.steps=200"]);
    command
}

#[test]
fn a_killed_power_goes_on_with_the_cases_it_has() {
    let folder = quick::tables();
    let (whole, broken) = (folder.path().join("whole"), folder.path().join("broken"));
    let cases = |out: &Path| out.join("7-power/cases.jsonl");
    let rates = |out: &Path| fs::read_to_string(out.join("7-power/power.json"));
    kill_when(&mut power(folder.path(), &broken), || lines(&cases(&broken)) >= 5);
    let kept = fs::read_to_string(cases(&broken)).unwrap();
    assert!(kept.lines().count() < 70 && rates(&broken).is_err());
    // A kill may occur in the middle of a line.
    let (before, _) = kept.trim_end().rsplit_once('\n').unwrap();
    let cut = &kept[..before.len() + 20];
    fs::write(cases(&broken), cut).unwrap();

    let (code, text) = quick::said(&mut power(folder.path(), &broken));
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = quick::said(&mut power(folder.path(), &whole));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(rates(&broken).unwrap(), rates(&whole).unwrap());
    let all = fs::read_to_string(cases(&broken)).unwrap();
    assert!(all.starts_with(&format!("{cut}\n")));
    let sorted = |text: &str| {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines.retain(|line| line != &cut[before.len() + 1..]);
        lines.sort();
        lines
    };
    // Each case is present exactly once.
    assert_eq!(sorted(&all), sorted(&fs::read_to_string(cases(&whole)).unwrap()));
}
