//! Skeletons of plugins in C and C++: the command writes them, the command line that it prints compiles them without a
//! warning, and they keep their contracts and serve one study.

use std::fs;
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

use crate::quick::{command, summary};

/// Kinds that libraries can provide, each with a wrong option of its skeleton and the complaint about it.
pub const KINDS: [(&str, &str, &str); 8] = [
    ("design", "random_start=1", "true or false"),
    ("discrepancy", "scale=0", "a number above 0"),
    ("effect", "deviation='wide'", "a number above 0"),
    ("model", "background=inf", "a finite number"),
    ("quantity", "about_mean='yes'", "true or false"),
    ("reader", "path=3", "the path of a file"),
    ("sampler", "chains=1", "a whole number from 2"),
    ("surrogate", "length=-1.5", "a number above 0"),
];

/// Turn every warning into an error; what the program does with the code, it does without optimisation too.
pub const STRICT: [&str; 5] = ["-Wall", "-Wextra", "-pedantic", "-Werror", "-O0"];

/// True if there is a compiler.
pub fn has(compiler: &str) -> bool {
    let there = Command::new(compiler).arg("--version").output().is_ok();
    if !there {
        println!("skipped: there is no `{compiler}`");
    }
    there
}

/// Standard output of a command with this exit code, and its standard error.
pub fn told(command: &mut Command, code: i32) -> String {
    let output = command.output().unwrap();
    let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert_eq!(output.status.code(), Some(code), "{command:?}: {text}");
    text
}

/// Writes the skeleton of a kind as `trial_KIND`; returns the command line that the command prints.
fn written(folder: &Path, kind: &str, language: &str) -> Vec<String> {
    let words = ["new", "plugin", kind, &format!("trial_{kind}"), "--language", language];
    let told = told(command().args(words).current_dir(folder), 0);
    let line = told.lines().find_map(|line| line.trim().strip_prefix("2. ")).unwrap();
    line.split_whitespace().map(str::to_owned).collect()
}

/// Compiles a library by this command line and more flags.
fn compiled(folder: &Path, line: &[String], flags: &[&str]) {
    told(Command::new(&line[0]).args(&line[1..]).args(flags).current_dir(folder), 0);
}

/// Tests a library with this option, if any; returns what is told.
fn tested(folder: &Path, kind: &str, set: Option<&str>, code: i32) -> String {
    let mut command = command();
    command.args(["plugins", "test", &format!("libtrial_{kind}.so")]).current_dir(folder);
    command.args(set.map(|set| format!("--set={kind}.trial_{kind}.{set}")));
    told(&mut command, code)
}

/// A folder with the skeletons of all kinds in a language, compiled and tested one beside the other.
fn all_kinds(language: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::thread::scope(|scope| {
        for (kind, wrong, expected) in KINDS {
            let line = written(path, kind, language);
            scope.spawn(move || {
                compiled(path, &line, &STRICT);
                let kept = tested(path, kind, None, 0);
                assert_eq!(kept, format!("{kind}.trial_{kind}  keeps its contract\n"));
                let complaint = tested(path, kind, Some(wrong), 1);
                assert!(complaint.contains(expected), "{kind} {wrong}: {complaint}");
                let (key, _) = wrong.split_once('=').unwrap();
                assert!(complaint.contains(&format!("wrong value for `{key}`")), "{complaint}");
            });
        }
    });
    folder
}

/// A discharging capacitor; every part of the study comes from one of the libraries.
const STUDY: &str = r#"
[plugins]
load = ["./libtrial_design.so", "./libtrial_discrepancy.so", "./libtrial_effect.so", "./libtrial_model.so",
        "./libtrial_quantity.so", "./libtrial_reader.so", "./libtrial_sampler.so", "./libtrial_surrogate.so"]
[study]
name = "compiled"
title = "The rate of a discharge"
seed = 11
[[parameter]]
name = "amplitude"
unit = "V"
prior = { uniform = [1, 3] }
[[parameter]]
name = "rate"
unit = "1/s"
prior = { uniform = [0.5, 1.5] }
[response]
name = "voltage"
unit = "V"
axes = { time = { first = 0.2, last = 2.0, count = 10, unit = "s" } }
[model]
use = "trial_model"
background = 0.1
[[effect]]
use = "trial_effect"
# Nearly the same as a change of the rate: with a wide prior this sampler would need many steps.
deviation = 0.001
[design]
use = "trial_design"
runs = 40
[measurements]
use = "trial_reader"
path = "measured.csv"
[surrogate]
use = "trial_surrogate"
validation = 8
[discrepancy]
use = "trial_discrepancy"
[sampler]
use = "trial_sampler"
steps = 4000
width = 0.05
[[quantity]]
name = "crest"
use = "trial_quantity"
"#;

/// Runs the study on the libraries of a folder: an amplitude of 2 V that decays at a rate of 1/s, with scatter as of
/// noise of 0.01 V. One value was not measured.
fn serves_one_study(folder: &Path) {
    let row = |(r, i): (u32, u32)| {
        let t = 0.2 * f64::from(i + 1);
        let noise = 0.014 * f64::from(7 * i + 11 * r + i * i * r).sin();
        let y = 2.0 * (-t).exp() + 0.1 + noise;
        let y = if (r, i) == (1, 4) { "nan".to_owned() } else { y.to_string() };
        format!("p{r},{t},{y}\n")
    };
    let rows: String = (0..4).flat_map(|r| (0..10).map(move |i| (r, i))).map(row).collect();
    fs::write(folder.join("measured.csv"), format!("replicate,time,voltage\n{rows}")).unwrap();
    fs::write(folder.join("study.toml"), STUDY).unwrap();
    told(command().args(["run", "study.toml", "--out", "out"]).current_dir(folder), 0);
    let summary = summary(&folder.join("out"));
    for (name, truth) in [("amplitude", 2.0), ("rate", 1.0)] {
        let of = |key: &str| summary["parameters"][name][key].as_f64().unwrap();
        let (mean, sd) = (of("mean"), of("sd"));
        assert!((mean - truth).abs() < 4.0 * sd && sd < 0.05, "{name}: {mean} ± {sd}");
    }
    // The largest of ten values over their root mean square, computed from the truth.
    let curve: Vec<f64> = (1..=10).map(|i| 2.0 * (-0.2 * f64::from(i)).exp() + 0.1).collect();
    let square = curve.iter().map(|y| y * y).sum::<f64>() / 10.0;
    let found = summary["quantities"]["crest"]["mean"].as_f64().unwrap();
    assert!((found - curve[0] / square.sqrt()).abs() < 0.03, "{found}");
}

#[test]
fn the_skeletons_in_c_keep_their_contracts_and_serve_one_study() {
    if has("cc") {
        serves_one_study(all_kinds("c").path());
    }
}

#[test]
fn the_skeletons_in_cpp_keep_their_contracts_and_serve_one_study() {
    if has("c++") {
        serves_one_study(all_kinds("c++").path());
    }
}

/// An exception in a skeleton in C++ ends what is done with its message, and not the program.
#[test]
fn an_exception_in_a_skeleton_in_cpp_is_told() {
    if !has("c++") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let line = written(path, "design", "cpp");
    let file = path.join("trial_design.cpp");
    let text = fs::read_to_string(&file).unwrap();
    let body = "    LacunaRandom random = lacuna_random(key);\n";
    // The contract asks for points of one, three and four coordinates.
    let throws = "    if (dimension == 1) throw std::runtime_error(\"the cube is full\");\n    \
                  if (dimension == 3) throw lacuna::Rejected(\"another key would do\");\n    \
                  if (dimension == 4) throw 7;\n";
    assert!(text.contains(body));
    fs::write(&file, text.replace(body, &format!("{throws}{body}"))).unwrap();
    compiled(path, &line, &["-O0"]);
    let told = tested(path, "design", None, 1);
    for expected in [
        "BREAKS its contract",
        "the cube is full",
        "another key would do",
        "an exception of an unknown type",
    ] {
        assert!(told.contains(expected), "{expected} is missing in {told}");
    }
}

#[test]
fn what_cannot_be_written_in_a_language_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |words: &[&str]| {
        let words = [&["new", "plugin"][..], words].concat();
        told(command().args(words).current_dir(folder.path()), 2)
    };
    for (language, called) in [("c", "C"), ("c++", "C++"), ("python", "Python")] {
        let text = refused(&["executor", "pool_two", "--language", language]);
        let expected = format!("error: there is no skeleton of the kind `executor` in {called}");
        assert!(text.contains(&expected) && text.contains("`surrogate`"), "{text}");
    }
    let text = refused(&["sampler", "Walk", "--language", "c++"]);
    assert!(text.contains("error: `Walk` is no name of a plugin"), "{text}");
    assert!(refused(&["sampler", "metropolis", "--language", "c"]).contains("there is a sampler"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);

    // A word of the language is a good name, because it stands in texts alone; a file is not written over.
    written(folder.path(), "quantity", "c");
    let words = ["new", "plugin", "quantity", "double", "--language", "c"];
    let text = told(command().args(words).current_dir(folder.path()), 0);
    assert!(text.starts_with("wrote double.c\n"), "{text}");
    let text = refused(&["quantity", "double", "--language", "c"]);
    assert!(text.contains("error: double.c is there already"), "{text}");
}
