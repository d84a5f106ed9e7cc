//! Successful runs.

use lacuna::plugin::model::EvalError;

use super::{Case, LINE};

#[test]
fn a_command_is_run_through_templates_and_a_reader() {
    let case = Case::shell(
        "sh ./deck.sh; echo done {{ run }}",
        "templates = [{ from = \"deck.template\", to = \"deck.sh\" }]",
    );
    case.file("deck.template", LINE);
    assert_eq!(case.run().unwrap(), [2.5, 4.5, 6.5]);
    assert_eq!(case.read("runs/run7/stdout.txt"), "done run7\n");
    assert_eq!(case.read("runs/run7/stderr.txt"), "");
    assert!(case.read("runs/run7/deck.sh").contains("2.0 * $t + 0.5"));
    // An evaluation without a folder leaves no files.
    let before = std::fs::read_dir(case.study.path()).unwrap().count();
    assert_eq!(case.ask(&[1.0, 0.0], None).unwrap(), [1.0, 2.0, 3.0]);
    assert_eq!(std::fs::read_dir(case.study.path()).unwrap().count(), before);
}

#[test]
fn inputs_reach_a_command_as_json() {
    let case = Case::new("command = [\"cat\"]\ninput = \"json\"\noutput = \"json\"");
    // `cat` returns its input, which is not a response.
    let reason = case.reason();
    assert!(reason.starts_with("the response has no") || reason.contains("found an object"));
    let asked: serde_json::Value =
        serde_json::from_str(&case.read("runs/run7/input.json")).unwrap();
    let expected = serde_json::json!({
        "run": "run7",
        "inputs": { "a": 2.0, "b": 0.5 },
        "scenario": { "name": "", "values": {}, "functions": {} },
        "layout": {
            "name": "y", "unit": "1",
            "axes": [{ "name": "time", "values": [1.0, 2.0, 3.0], "unit": "s" }],
        },
    });
    assert_eq!(asked, expected);
}

#[test]
fn json_is_read_from_what_is_printed() {
    let case = Case::new(
        "command = [\"sh\", \"-c\", \"echo at work; echo '[{{ a }}, {{ b }}, 3]'\"]\noutput = \"json\"",
    );
    assert_eq!(case.run().unwrap(), [2.0, 0.5, 3.0]);
}

#[test]
fn the_environment_copies_and_links_are_there() {
    let case = Case::shell(
        "test -f mesh.g && test -L large.g && test -f parts/inner/p && \
         printf \"time,y\\n1,$LEVEL\\n2,$(cat mesh.g)\\n3,$(cat large.g)\\n\" > y.csv",
        "copy = [\"mesh.g\", \"parts\"]\nlink = [\"large.g\"]\nenvironment = { LEVEL = \"{{ a | %.2f }}{{ b | %.0e }}\" }",
    );
    std::fs::create_dir_all(case.study.path().join("parts/inner")).unwrap();
    case.file("mesh.g", "7").file("large.g", "8").file("parts/inner/p", "");
    assert_eq!(case.run().unwrap()[1..], [7.0, 8.0]);
    assert!(case.read("runs/run7/y.csv").contains("1,2.005e-01\n"));
}

#[test]
fn a_program_beside_the_study_is_found_and_belongs_to_its_files() {
    use std::os::unix::fs::PermissionsExt as _;
    let case = Case::new("command = [\"./solver\", \"{{ a }}\", \"{{ b }}\"]\noutput = \"json\"");
    case.file("solver", "#!/bin/sh\necho \"[$1, $2, 0]\"\n");
    let path = case.study.path().join("solver");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    assert_eq!(case.run().unwrap(), [2.0, 0.5, 0.0]);
    assert_eq!(case.model.files(case.study.path()), [case.study.path().join("./solver")]);
    let script = Case::new("command = [\"sh\", \"{{ study }}/solver\"]\noutput = \"json\"");
    script.file("solver", "");
    assert_eq!(script.model.files(script.study.path()), [script.study.path().join("solver")]);
}

#[test]
fn a_run_that_failed_is_tried_again_in_a_fresh_folder() {
    let script = format!(
        "echo x >> {{{{ study }}}}/tries; test -e left && exit 9; touch left\n\
         test $(wc -l < {{{{ study }}}}/tries) -lt 3 && exit 4\n{LINE}"
    );
    let case = Case::shell(&script, "retries = 2");
    assert_eq!(case.run().unwrap(), [2.5, 4.5, 6.5]);
    assert_eq!(case.read("tries").lines().count(), 3);
    let folders = ["attempt1", "attempt2", "attempt3"];
    assert!(folders.iter().all(|name| case.study.path().join("runs/run7").join(name).is_dir()));
    let hopeless = Case::shell("echo x >> {{ study }}/tries; echo no >&2; exit 4", "retries = 1");
    assert_eq!(
        hopeless.reason(),
        "`sh` ended with exit code 4; it said: no (the last of 2 attempts)"
    );
    assert_eq!(hopeless.read("tries").lines().count(), 2);
}

#[test]
fn folders_stay_as_the_study_says() {
    let there = |keep: &str, script: &str| {
        let case = Case::shell(script, &format!("keep = \"{keep}\""));
        let _ = case.run();
        case.study.path().join("runs/run7").is_dir()
    };
    assert_eq!(["all", "failed", "none"].map(|keep| there(keep, LINE)), [true, false, false]);
    assert_eq!(["all", "failed", "none"].map(|keep| there(keep, "exit 1")), [true, true, false]);
}

#[test]
fn inputs_that_are_no_numbers_are_refused() {
    let case = Case::shell(LINE, "");
    let rejected = |text: &str| Err(EvalError::Rejected(text.to_owned()));
    assert_eq!(case.ask(&[f64::NAN, 0.5], None), rejected("the input `a` is NaN"));
    assert_eq!(case.ask(&[2.0, f64::INFINITY], None), rejected("the input `b` is inf"));
    let few = case.ask(&[2.0], None);
    assert_eq!(few, Err(EvalError::Fatal("expected 2 inputs, found 1".to_owned())));
}

#[test]
fn a_command_that_is_not_there_stops_the_study() {
    let case = Case::new("command = [\"no-such-solver\"]\noutput = \"json\"");
    let stopped = case.ask(&[2.0, 0.5], None);
    assert_eq!(stopped, Err(EvalError::Fatal("there is no program `no-such-solver`".to_owned())));
}
