#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::*;

fn shell(script: &str, folder: &Path) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", script]).current_dir(folder).stdin(Stdio::null());
    command
}

/// A shell that starts a child, writes the child's id to the file `child`, and goes on.
const PARENT: &str = "sleep 100 & echo $! > child; sleep 100";

/// Returns `true` once the id of the child is written: the shell creates the file before it writes to it.
fn started(file: &Path) -> bool {
    fs::read_to_string(file).is_ok_and(|pid| pid.ends_with('\n'))
}

/// Returns `true` if the process whose id is in a file ends within twenty seconds.
fn ends(file: &Path) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(20) {
        let pid = fs::read_to_string(file).unwrap_or_default();
        let state = fs::read_to_string(format!("/proc/{}/stat", pid.trim())).unwrap_or_default();
        // A zombie process has ended; its parent, which must wait for it, is not under the test's control.
        if !pid.is_empty() && (state.is_empty() || state.contains(") Z ")) {
            return true;
        }
        thread::sleep(Duration::from_millis(10));
    }
    false
}

#[test]
fn what_takes_too_long_is_ended_with_its_children() {
    let folder = tempfile::tempdir().unwrap();
    let child = folder.path().join("child");
    let mut process = Process::start(&mut shell(PARENT, folder.path())).unwrap();
    while !started(&child) {
        thread::sleep(Duration::from_millis(10));
    }
    let begun = Instant::now();
    assert_eq!(process.wait(Some(Duration::from_millis(300))).unwrap(), None);
    assert!(begun.elapsed() < Duration::from_secs(50), "the shell would sleep for 100 s");
    assert!(ends(&child));
}

#[test]
fn what_must_not_go_on_is_ended_with_its_children() {
    let folder = tempfile::tempdir().unwrap();
    let child = folder.path().join("child");
    let mut process = Process::start(&mut shell(PARENT, folder.path())).unwrap();
    assert_eq!(process.wait_while(None, || !started(&child)).unwrap(), End::Stopped);
    assert!(ends(&child));
}

#[test]
fn what_a_finished_process_left_running_is_ended() {
    let folder = tempfile::tempdir().unwrap();
    let script = "sleep 100 & echo $! > child; exit 3";
    let mut process = Process::start(&mut shell(script, folder.path())).unwrap();
    assert_eq!(process.wait(None).unwrap().unwrap().code(), Some(3));
    assert!(ends(&folder.path().join("child")));
}

#[test]
fn who_ends_the_simulator_has_time_to_end_this_program_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut process = Process::start(&mut shell("kill -s TERM $$", folder.path())).unwrap();
    let begun = Instant::now();
    let status = process.wait(None).unwrap();
    assert!(status.is_some_and(|status| status.code().is_none()), "{status:?}");
    assert!(begun.elapsed() >= super::GRACE);
}

#[test]
fn the_guard_forgets_a_group_that_has_ended() {
    let folder = tempfile::tempdir().unwrap();
    let script = super::guard::SCRIPT.replace("kill -s KILL --", "echo");
    let lines = "printf '+ 12\\n+ 34\\n+ 5\\n- 34\\n- 12\\n+ 345\\n'";
    let output = shell(&format!("{lines} | sh -c \"$SCRIPT\""), folder.path())
        .env("SCRIPT", script)
        .output()
        .unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), "-5\n-345\n");
}

#[test]
fn the_guard_ends_what_runs_when_its_pipe_closes() {
    let folder = tempfile::tempdir().unwrap();
    let mut sleeper =
        Process::start(&mut shell("echo $$ > child; sleep 100", folder.path())).unwrap();
    let group = sleeper.child().id();
    let script = format!("echo '+ {group}' | sh -c \"$SCRIPT\"");
    shell(&script, folder.path()).env("SCRIPT", super::guard::SCRIPT).status().unwrap();
    let status = sleeper.wait(Some(Duration::from_secs(5))).unwrap();
    assert!(status.is_some_and(|status| status.code().is_none()), "{status:?}");
}

#[test]
fn the_end_of_a_text_is_a_few_short_lines() {
    let text: String = (1..=9).map(|i| format!("line {i}\n\n")).collect();
    assert_eq!(tail(text.as_bytes()), "line 5\nline 6\nline 7\nline 8\nline 9");
    assert_eq!(tail("x".repeat(500).as_bytes()).chars().count(), 201);
    assert_eq!(tail(b"\xff\x1b[1mred"), "\u{fffd}[1mred");
}
