//! Output of the command line about libraries.

use std::path::Path;

use super::{quick, twin_path};

/// Runs a command; returns true if it succeeded, and its output.
fn said(arguments: &[&str]) -> (bool, String) {
    let output = quick::command().args(arguments).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8(text).unwrap())
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn plugins_of_a_library_are_listed_with_their_origin() {
    let library = twin_path();
    let sha256 = lacuna::run::files::hash_file(&library).unwrap();
    let (done, all) = said(&["plugins", "sampler", "--plugin", path(&library)]);
    assert!(done, "{all}");
    let words = all.split_whitespace().collect::<Vec<_>>().join(" ");
    let origin = format!("(lacuna-twin 0.1.0, abi 1.2, sha256 {sha256})");
    assert!(words.contains("twin_nested") && words.contains(&origin), "{all}");

    let (done, page) = said(&["plugins", "discrepancy.twin_gaussian", "--plugin", path(&library)]);
    assert!(done && page.contains(&origin), "{page}");
    let (_, own) = said(&["plugins", "discrepancy.gaussian"]);
    // Aliases belong to a registration in the source tree; libraries do not declare any.
    let manual = |page: &str| {
        let lines: Vec<&str> = page.lines().skip(1).collect();
        let names = lines.iter().position(|line| line.starts_with("Known elsewhere as "));
        let rest = |i: usize| [&lines[..i], &lines[i + 2..]].concat();
        let lines = names.map_or_else(|| lines.clone(), rest).into_iter();
        lines.take_while(|l| !l.starts_with("from ")).map(str::to_owned).collect::<Vec<_>>()
    };
    let (mut a, b) = (manual(&page.replace("twin_", "")), manual(&own));
    a.truncate(b.len());
    assert_eq!(a, b);

    let (done, schema) = said(&["schema", "--plugin", path(&library)]);
    assert!(done && schema.contains("\"const\":\"twin_gaussian\""));
    let (done, schema) = said(&["schema", "summary"]);
    assert!(done && schema.contains("\"title\": \"Lacuna summary\""), "{schema}");
    let (done, refused) = said(&["plugins", "--plugin", "no/such.so"]);
    assert!(!done);
    assert_eq!(
        refused,
        "error: the library of plugins no/such.so cannot be used: no such file or directory\n"
    );
}

#[test]
fn a_check_says_what_would_be_loaded() {
    let folder = quick::tables();
    let study = folder.path().join("study.toml");
    let library = folder.path().join("libheard.so");
    std::fs::write(&library, "lacuna-plugin-record:1.0\ndiscrepancy=heard\nend\n").unwrap();
    quick::replace(&study, "use = \"gaussian\"", "use = \"heard\"");
    let text = std::fs::read_to_string(&study).unwrap();
    std::fs::write(&study, format!("{text}\n[plugins]\nload = [\"libheard.so\"]\n")).unwrap();
    let (done, text) = said(&["check", path(&study)]);
    assert!(done, "{text}");
    let expected = "would load libheard.so: discrepancy `heard`, abi 1.0, sha256 ";
    assert!(text.starts_with(expected) && text.contains("no problems"), "{text}");
    std::fs::write(&library, "something else").unwrap();
    let (done, text) = said(&["check", path(&study)]);
    assert!(!done && text.contains("it says nothing of itself"), "{text}");
    assert!(text.contains("there is no discrepancy `heard`"), "{text}");
}

/// A library that the command line names is loaded, so that the options of its plugins are checked.
#[test]
fn a_check_loads_what_the_command_line_names() {
    let folder = quick::tables();
    let study = folder.path().join("study.toml");
    quick::replace(&study, "use = \"gaussian\"", "use = \"twin_gaussian\"\nunheard_of = 1");
    let library = twin_path();
    let (done, text) = said(&["check", path(&study), "--plugin", path(&library)]);
    assert!(!done && text.contains("unknown key `unheard_of`"), "{text}");
}

#[test]
fn a_run_and_its_resumption_load_what_the_command_line_names() {
    let folder = quick::tables();
    let study = folder.path().join("study.toml");
    quick::replace(&study, "use = \"gaussian\"", "use = \"twin_gaussian\"");
    let out = folder.path().join("out");
    let library = twin_path();
    let (done, text) = said(&[
        "run",
        path(&study),
        "--out",
        path(&out),
        "--plugin",
        path(&library),
        "--set",
        "sampler.walkers=12",
        "--set",
        "sampler.steps=60",
    ]);
    assert!(done, "{text}");
    let (done, text) = said(&["resume", path(&out)]);
    assert!(done, "{text}");
    let (done, text) = said(&["report", path(&out)]);
    assert!(done, "{text}");
}
