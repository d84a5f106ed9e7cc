//! Models of a library in separate processes, here and on a cluster: the bits are those of this process, and each
//! process loads the intended file or none.

use std::path::{Path, PathBuf};
use std::process::Command;

use lacuna::text::emit;
use tempfile::TempDir;

use super::slurm::{Kind, started};
use super::{quick, twin_path};

/// A study with its own library, which contains its model.
fn study() -> (TempDir, PathBuf) {
    let folder = quick::simulated();
    let path = folder.path().join("study.toml");
    std::fs::copy(twin_path(), folder.path().join("libtwin.so")).unwrap();
    quick::replace(&path, "[study]", "[plugins]\nload = [\"libtwin.so\"]\n\n[study]");
    quick::replace(&path, "use = \"mercury_target\"", "use = \"twin_mercury_target\"");
    (folder, path)
}

fn run(study: &Path, out: &Path, executor: &str) -> Command {
    let mut command = quick::command();
    command.arg("run").arg(study).arg("--out").arg(out);
    command.args(["--set", &format!("executor={{ {executor} }}")]);
    command
}

#[test]
fn a_model_of_a_library_gives_the_same_bits_in_other_processes() {
    let (folder, path) = study();
    let (threads, processes) = (folder.path().join("threads"), folder.path().join("processes"));
    for (out, executor) in
        [(&threads, "use = \"local\", threads = 2"), (&processes, "use = \"local\", processes = 2")]
    {
        let (code, text) = quick::said(&mut run(&path, out, executor));
        assert_eq!(code, Some(0), "{text}");
    }
    assert_eq!(quick::results(&processes), quick::results(&threads));
    assert!(processes.join("2-simulate/campaign/done/run040.json").exists());
}

#[test]
fn a_model_of_a_library_gives_the_same_bits_on_a_cluster() {
    let Some(slurm) = started(Kind::Plain) else { return };
    let (folder, path) = study();
    let (here, there) = (folder.path().join("here"), folder.path().join("there"));
    let (code, text) = quick::said(&mut run(&path, &here, "use = \"local\""));
    assert_eq!(code, Some(0), "{text}");
    let executor = "use = \"slurm\", pack = 10, poll = 1, patience = 1";
    let (code, text) = quick::said(run(&path, &there, executor).env("SLURM_CONF", slurm.conf()));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(quick::results(&there), quick::results(&here));
}

/// The processes of cases load the library too, and the posterior of the run is found again.
#[test]
fn cases_of_a_study_with_a_library_are_the_same_in_other_processes() {
    let (folder, path) = study();
    let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
    let (code, text) = quick::said(&mut run(&path, &here, "use = \"local\""));
    assert_eq!(code, Some(0), "{text}");
    let count = |out: &Path, settings: &[&str]| {
        let mut command = quick::command();
        // The noise at draws of the posterior needs that of the run.
        command.args(["coverage", "--count", "2", "--noise", "posterior", "--out"]);
        command.arg(out).arg(&path).args(settings);
        let (code, text) = quick::said(&mut command);
        assert_eq!(code, Some(0), "{text}");
        std::fs::read_to_string(out.join("7-coverage/cases.json")).unwrap()
    };
    let cases = count(&here, &[]);
    assert!(!here.join(".kept").exists(), "no stage was made from other inputs");
    let processes = "cases={ use = \"local\", processes = 2 }";
    assert_eq!(count(&there, &["--set", processes]), cases);
}

#[cfg(unix)]
#[test]
fn a_library_that_was_exchanged_meanwhile_is_refused_by_the_worker() {
    let (folder, path) = study();
    let library = folder.path().join("libtwin.so");
    // The program of the workers replaces the file before they begin, as happens when somebody rebuilds it.
    let program = folder.path().join("late");
    let lacuna = quick::command().get_program().to_str().unwrap().to_owned();
    let own = library.display();
    let text = format!(
        "#!/bin/sh\ncp '{own}' '{own}.new'\necho >> '{own}.new'\nmv '{own}.new' '{own}'\nexec '{lacuna}' \"$@\"\n"
    );
    std::fs::write(&program, text).unwrap();
    assert!(Command::new("chmod").arg("+x").arg(&program).status().unwrap().success());
    let before = lacuna::run::files::hash_file(&library).unwrap();
    let executor = format!(
        "use = \"local\", processes = 1, program = {}",
        emit::string(program.to_str().unwrap())
    );
    let out = folder.path().join("out");
    let (code, text) = quick::said(&mut run(&path, &out, &executor));
    // Only the end of a worker's output is shown, up to a length; the hash that it found comes last.
    let after = lacuna::run::files::hash_file(&library).unwrap();
    assert_eq!(code, Some(1), "{text}");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        words.contains(&format!(
            "the library of plugins {own} cannot be used: it is not the pinned file"
        )),
        "{text}"
    );
    assert!(
        words.contains(&format!("expected sha256 `{before}`, found `{}", &after[..8])),
        "{text}"
    );
    assert!(!out.join("2-simulate/stage.json").exists());
}

/// A chain whose first part is in a library.
const CHAIN: &str = r#"
[plugins]
load = ["libtwin.so"]
[study]
name = "chain"
title = "A chain with a part from a library"
seed = 3
[[parameter]]
name = "a"
prior = { uniform = [0, 1] }
[response]
name = "y"
axes = { t = { first = 1, last = 3, count = 3, unit = "1" } }
[model]
use = "composed"
[[model.parts]]
use = "twin_equations"
name = "first"
observe = "2 * a"
gives = { name = "b", unit = "1" }
[[model.parts]]
use = "equations"
name = "second"
observe = "b * t"
[design]
use = "latin_hypercube"
runs = 6
[executor]
use = "local"
processes = 2
[measurements]
use = "csv"
path = "measured.csv"
[surrogate]
use = "polynomial_chaos"
degree = 1
[discrepancy]
use = "gaussian"
variance = { known = 0.01 }
[sampler]
use = "affine_invariant_ensemble"
walkers = 8
steps = 20
[validate]
emulator_check = 0
rerun_model = false
"#;

/// Hash of a stage's inputs, and number of libraries that the workers of its runs were told to load.
fn simulated(folder: &Path) -> (String, usize) {
    let out = folder.join("out");
    let study = folder.join("study.toml");
    let mut command = quick::command();
    let (code, text) = quick::said(command.arg("run").arg(&study).arg("--out").arg(&out));
    assert_eq!(code, Some(0), "{text}");
    let read = |file: &str| -> serde_json::Value {
        lacuna::run::files::read_json(&out.join("2-simulate").join(file)).unwrap()
    };
    let libraries =
        read("campaign/local/order.json")["model"]["libraries"].as_array().map(Vec::len);
    (read("stage.json")["inputs"].as_str().unwrap().to_owned(), libraries.unwrap_or(0))
}

#[test]
fn a_stage_is_made_again_when_the_library_of_a_part_changes() {
    let folder = tempfile::tempdir().unwrap();
    let (study, library) = (folder.path().join("study.toml"), folder.path().join("libtwin.so"));
    std::fs::write(&study, CHAIN).unwrap();
    let measured = "replicate,t,y\n1,1,0.8\n1,2,1.7\n1,3,2.4\n2,1,0.9\n2,2,1.6\n2,3,2.5\n";
    std::fs::write(folder.path().join("measured.csv"), measured).unwrap();
    std::fs::copy(twin_path(), &library).unwrap();
    let (first, told) = simulated(folder.path());
    assert_eq!(told, 1);
    assert_eq!(simulated(folder.path()).0, first);
    // Bytes after the end of a library are ignored, but they make it another file.
    let mut bytes = std::fs::read(&library).unwrap();
    bytes.push(0);
    std::fs::remove_file(&library).unwrap();
    std::fs::write(&library, &bytes).unwrap();
    let (second, _) = simulated(folder.path());
    assert_ne!(second, first);
    // Without a part from the library, the model does not depend on it.
    quick::replace(&study, "twin_equations", "equations");
    let (without, told) = simulated(folder.path());
    assert_eq!(told, 0);
    bytes.push(0);
    std::fs::remove_file(&library).unwrap();
    std::fs::write(&library, &bytes).unwrap();
    assert_eq!(simulated(folder.path()).0, without);
}
