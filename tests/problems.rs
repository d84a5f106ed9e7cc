//! Wrong studies and the problems reported for them.
//!
//! Each file of `problems/` is a wrong study, followed by the expected problems in lines that begin with `#!`.
//! `LACUNA_BLESS=1` replaces these lines by the present output.

use std::fs;
use std::path::{Path, PathBuf};

use lacuna_engine::study::resolve::load_text;
// Without this line the linker leaves the plugins out.
use lacuna_plugins as _;

/// Output of `lacuna check` for a study; `name` is its path from the folder of the tests.
fn check_text(name: &str, text: &str) -> String {
    let checked = load_text(Path::new(name), text, &[]);
    checked.problems.render(&checked.sources)
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("problems")
}

/// All studies of the folder, sorted by name.
fn studies() -> Vec<PathBuf> {
    let entries = fs::read_dir(folder()).expect("the folder of wrong studies");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.sort();
    paths
}

/// The study, and the expected problems in the comments at its end.
fn split(text: &str) -> (&str, String) {
    let is_comment = |line: &&str| line.starts_with("#!");
    let comments: usize =
        text.split_inclusive('\n').rev().take_while(is_comment).map(str::len).sum();
    let (study, comments) = text.split_at(text.len() - comments);
    let line =
        |comment: &str| comment["#!".len()..].strip_prefix(' ').unwrap_or("").to_owned() + "\n";
    (study, comments.lines().map(line).collect())
}

/// Problems formatted as comments at the end of a study.
fn comments(said: &str) -> String {
    let comment = |line: &str| if line.is_empty() { "#!\n".into() } else { format!("#! {line}\n") };
    said.lines().map(comment).collect()
}

#[test]
fn wrong_studies_get_the_complaints_they_should() {
    let bless = std::env::var_os("LACUNA_BLESS").is_some_and(|value| value == "1");
    let mut different = Vec::new();
    for path in studies() {
        let name = format!("problems/{}", path.file_name().unwrap().display());
        let text = fs::read_to_string(&path).unwrap();
        let (study, expected) = split(&text);
        let said = check_text(&name, study);
        if bless {
            fs::write(&path, format!("{study}{}", comments(&said))).unwrap();
        } else if said.is_empty() {
            different.push(format!("{name}: nothing is said about it\n"));
        } else if said != expected {
            different.push(format!("{name}\n--- expected\n{expected}--- said\n{said}"));
        }
    }
    assert!(
        different.is_empty(),
        "{}\nset LACUNA_BLESS=1 to accept what is said now",
        different.join("\n")
    );
}

#[test]
fn comments_are_taken_off_and_put_back() {
    let text = "a = 1\n# a comment of the study\n#! first\n#!\n#!   | x\n";
    let (study, said) = split(text);
    assert_eq!(study, "a = 1\n# a comment of the study\n");
    assert_eq!(said, "first\n\n  | x\n");
    assert_eq!(format!("{study}{}", comments(&said)), text);
}

#[test]
fn a_margin_widens_the_design_of_bounded_priors() {
    let text = fs::read_to_string(folder().join("design_margin.toml")).unwrap();
    let (study, _) = split(&text);
    let share = "prior = { beta = [2.0, 2.0] }";
    for (prior, design) in [
        ("{ normal = [0.0, 1.0] }", "Normal([0.0, 1.0])"),
        ("{ log_uniform = [1.0, 100.0] }", "LogUniform([0.630957"),
        ("{ beta = [2.0, 2.0] }\ndesign = { uniform = [0.0, 1.0] }", "Uniform([0.0, 1.0])"),
    ] {
        let text = study.replace(share, &format!("prior = {prior}"));
        let checked = load_text(Path::new("margin.toml"), &text, &[]);
        let parameters = checked.study.expect("a study without faults").parameters;
        assert_eq!(format!("{:?}", parameters[0].design), "Uniform([0.8, 3.2])");
        let said = format!("{:?}", parameters[1].design);
        assert!(said.starts_with(design), "{prior}: {said}");
    }
}
