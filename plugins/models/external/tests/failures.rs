//! Failing runs: the exact reason, and no process left running.

use std::time::{Duration, Instant};

use super::{Case, LINE};
use crate::readers::sierra::write::{History, Origin, write_history};

#[test]
fn a_command_that_hangs_is_stopped_with_all_it_started() {
    let script = "echo 'step 1' >&2; (sleep 30; touch {{ study }}/later) & sleep 30";
    let case = Case::shell(script, "timeout = 2");
    let begun = Instant::now();
    assert_eq!(case.reason(), "`sh` was stopped after 2 s; it said: step 1");
    assert!(begun.elapsed() < Duration::from_secs(25));
    let study = case.study.path().display().to_string();
    let running = || {
        let processes = std::fs::read_dir("/proc").unwrap().flatten();
        let ours = |process: &std::fs::DirEntry| {
            let command = std::fs::read(process.path().join("cmdline")).unwrap_or_default();
            String::from_utf8_lossy(&command).contains(&study)
        };
        processes.filter(ours).count()
    };
    // A busy machine needs a moment to end a killed process.
    while running() > 0 && begun.elapsed() < Duration::from_secs(25) {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(running(), 0);
}

#[test]
fn a_command_that_prints_without_end_is_stopped() {
    let script = "echo begun; while :; do echo 0123456789 0123456789 0123456789; done";
    let reason = Case::shell(script, "max_printed = 0.5").reason();
    let expected = "`sh` printed more than 0.5 MB (`max_printed` in `[model]`); it said: 0123";
    assert!(reason.starts_with(expected), "{reason}");
    // What prints too much before it is looked at has failed as well.
    let quick = Case::shell("head -c 2000000 /dev/zero", "max_printed = 1.5").reason();
    assert!(quick.starts_with("`sh` printed more than 1.5 MB"), "{quick}");
}

#[test]
fn exit_codes_and_signals_are_told_with_the_end_of_the_errors() {
    let script = "echo out; for i in 1 2 3 4 5 6 7; do echo \"error $i\" >&2; done; exit 3";
    let reason =
        "`sh` ended with exit code 3; it said: error 3\nerror 4\nerror 5\nerror 6\nerror 7";
    assert_eq!(Case::shell(script, "").reason(), reason);
    // A program is named with its place, not with the text of the study.
    let own = Case::new("command = [\"{{ study }}/solver\"]\noutput = \"json\"");
    let solver = own.study.path().join("solver");
    std::os::unix::fs::symlink("/bin/false", &solver).unwrap();
    assert_eq!(own.reason(), format!("`{}` ended with exit code 1", solver.display()));
    let quiet = Case::shell("echo what is wrong; exit 1", "");
    assert_eq!(quiet.reason(), "`sh` ended with exit code 1; it said: what is wrong");
    assert_eq!(Case::shell("kill -s SEGV $$", "").reason(), "`sh` was ended by signal 11");
    let allowed = Case::shell(&format!("{LINE}; exit 2"), "success = { exit_codes = [0, 2] }");
    assert_eq!(allowed.run().unwrap(), [2.5, 4.5, 6.5]);
}

#[test]
fn a_run_must_say_that_it_converged() {
    let rules = "success = { file = \"run.log\", contains = [\"converged\"], lacks = [\"ERROR\"] }";
    let with = |log: &str| Case::shell(&format!("{LINE}\nprintf '{log}' > run.log"), rules);
    assert_eq!(with("converged\\n").run().unwrap(), [2.5, 4.5, 6.5]);
    assert_eq!(with("gave up\\n").reason(), "`run.log` does not contain `converged`");
    assert_eq!(
        with("1\\nstep 7: ERROR 12\\nconverged\\n").reason(),
        "`run.log` contains `ERROR`: step 7: ERROR 12"
    );
    assert_eq!(
        Case::shell(LINE, rules).reason(),
        "cannot read `run.log`: no such file or directory"
    );
}

#[test]
fn output_that_is_missing_garbage_or_cut_off_is_refused() {
    let mut different = Vec::new();
    for (script, reason) in [
        ("echo all is well", "`sh` wrote no file `y.csv`; it said: all is well"),
        ("head -c 100 /dev/zero > y.csv", "y.csv: has no column `time`"),
        (
            "printf 'time,y\\n1,1\\n2,2\\n' > y.csv",
            "y.csv: 1 of 3 values are missing, first at time 3 s",
        ),
        ("printf 'time,y\\n1,1\\n2,2\\n3' > y.csv", "y.csv, "),
        (
            "printf 'time,y\\n1,1\\n2,x\\n3,3\\n' > y.csv",
            "y.csv, line 3, column 2 (`y`): expected a number, found `x`",
        ),
        (
            "printf 'time,y\\n1,1\\n2,NaN\\n3,3\\n' > y.csv",
            "y.csv: 1 of 3 values are missing, first at time 2 s",
        ),
        ("printf 'time,y\\n1,1\\n2,inf\\n3,3\\n' > y.csv", "y.csv"),
        ("printf 'time,y\\n1,1\\n2,2\\n3,3\\n4,4\\n' > y.csv", "y.csv, line 5, "),
        ("mkdir y.csv", "y.csv"),
    ] {
        let found = Case::shell(script, "").reason();
        if !found.starts_with(reason) {
            different.push(format!("{script}\n{found}"));
        }
    }
    assert!(different.is_empty(), "{}", different.join("\n"));
}

#[test]
fn half_an_exodus_file_is_refused() {
    let signal = History {
        times: vec![1.0, 2.0, 3.0],
        names: vec!["y".to_owned()],
        values: vec![vec![4.0, 5.0, 6.0]],
    };
    let case = |script: &str| {
        let case = Case::new(&format!(
            "command = [\"sh\", \"-c\", '''{script}''']\n\
             output = {{ use = \"sierra\", path = \"y.h\", variable = \"y\" }}"
        ));
        write_history(&case.study.path().join("whole.h"), &Origin::default(), &signal).unwrap();
        case
    };
    assert_eq!(case("cp {{ study }}/whole.h y.h").run().unwrap(), [4.0, 5.0, 6.0]);
    let half = case("head -c 1500 {{ study }}/whole.h > y.h").reason();
    assert!(half.starts_with("y.h: is truncated or damaged"), "{half}");
    assert_eq!(case("true").reason(), "`sh` wrote no file `y.h`");
}

#[test]
fn json_that_is_no_response_is_refused() {
    let reason = |script: &str| {
        let command = format!("command = [\"sh\", \"-c\", '''{script}''']\noutput = \"json\"");
        Case::new(&command).reason()
    };
    let found = reason("echo '[1, 2]'");
    assert_eq!(found, "the response has 2 values, expected 3; it said: [1, 2]");
    let found = reason("echo '[1, 2, 1e999]'");
    assert!(found.starts_with("expected the response as JSON in the last line printed"), "{found}");
}
