//! `lacuna new plugin`: its output is the tested skeleton, in the right place, with another name.

use std::fs;
use std::path::Path;
use std::process::Command;

use lacuna::plugin::registry;
use tempfile::TempDir;

use crate::quick::{command, root, said};

/// Each kind with its folder.
const KINDS: [(&str, &str); 12] = [
    ("design", "designs"),
    ("discrepancy", "discrepancies"),
    ("effect", "effects"),
    ("executor", "executors"),
    ("model", "models"),
    ("quantity", "quantities"),
    ("reader", "readers"),
    ("reliability", "reliability"),
    ("sampler", "samplers"),
    ("surrogate", "surrogates"),
    ("target", "targets"),
    ("term", "terms"),
];

/// The skeleton of a kind, named `trial_KIND`.
fn trial(kind: &str) -> (String, String) {
    let template = root().join(format!("cli/src/new/plugin/{kind}.rs"));
    let of_code = format!("Trial{}{}", kind[..1].to_uppercase(), &kind[1..]);
    let name = format!("trial_{kind}");
    let text = fs::read_to_string(template).unwrap();
    (text.replace("Skeleton", &of_code).replace("skeleton", &name), name)
}

/// A folder with the part of the source that the command looks at.
fn source() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let copy = |file: &str| {
        let to = folder.path().join(file);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(root().join(file), to).unwrap();
    };
    ["plugins/Cargo.toml", "plugins/lib.rs"].into_iter().for_each(copy);
    for (_, kinds) in KINDS {
        copy(&format!("plugins/{kinds}/mod.rs"));
    }
    folder
}

/// Requests a plugin in a folder; returns the exit code and the output.
fn ask(folder: &Path, words: &[&str]) -> (Option<i32>, String) {
    let mut lacuna = command();
    said(lacuna.args(["new", "plugin"]).args(words).current_dir(folder))
}

#[test]
fn a_skeleton_of_each_kind_is_the_one_that_is_tested_under_another_name() {
    let kinds: Vec<&str> = registry::kinds().iter().map(|kind| kind.name).collect();
    assert_eq!(kinds, KINDS.map(|(kind, _)| kind));
    let tree = source();
    for (kind, kinds) in KINDS {
        let (text, name) = trial(kind);
        // Any folder of the tree must do.
        let output = command()
            .args(["new", "plugin", kind, &name])
            .current_dir(tree.path().join("plugins").join(kinds))
            .output()
            .unwrap();
        let told = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{kind}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(told.contains(&format!("docs/reference/{kind}.{name}.md")), "{told}");
        let folder = tree.path().join("plugins").join(kinds);
        assert_eq!(fs::read_to_string(folder.join(format!("{name}.rs"))).unwrap(), text);

        let before = fs::read_to_string(root().join("plugins").join(kinds).join("mod.rs")).unwrap();
        let after = fs::read_to_string(folder.join("mod.rs")).unwrap();
        let line = format!("pub mod {name};\n");
        assert_eq!(after.replacen(&line, "", 1), before, "{kind}");
        let block = after.split("\n\n").find(|block| block.contains(line.trim_end())).unwrap();
        let modules = block.lines().filter_map(|line| line.rsplit_once("mod "));
        let names: Vec<&str> = modules.map(|(_, name)| name).collect();
        assert!(names.is_sorted(), "{kind}: {names:?}");
    }
}

#[test]
fn what_cannot_be_written_is_refused_and_nothing_is_changed() {
    let tree = source();
    let list = tree.path().join("plugins/samplers/mod.rs");
    let before = fs::read_to_string(&list).unwrap();
    for (words, expected) in [
        (
            &["sampler", "Walk"][..],
            "error: `Walk` is no name of a plugin\nhelp: names are small letters",
        ),
        (&["sampler", "loop"], "error: `loop` is a keyword of Rust"),
        (&["sampler", "state"], "error: the type of `state` would be called `State`"),
        (&["sampler", "metropolis"], "error: there is a sampler `metropolis` already"),
        (&["sampler", "moves"], "has no place for the module `moves`"),
        (
            &["simulator", "walk"],
            "error: there is no kind `simulator` of plugins\nhelp: the kinds are `design`",
        ),
        (
            &["term", "loss", "--library", "loss"],
            "a library cannot bring plugins of the kind `term`",
        ),
        (&["design", "even", "--library", "plugins"], "error: plugins is there already"),
        (
            &["design", "even", "--library", "even", "--source", "/"],
            "error: / is not in Lacuna's source\nhelp: name a clone of it with `--source FOLDER`",
        ),
    ] {
        let (code, told) = ask(tree.path(), words);
        assert!(code == Some(2) && told.contains(expected), "{words:?}: {told}");
    }
    assert_eq!(fs::read_to_string(&list).unwrap(), before);

    let elsewhere = tempfile::tempdir().unwrap();
    let (code, told) = ask(elsewhere.path(), &["sampler", "walk"]);
    assert!(code == Some(2) && told.contains("is not in Lacuna's source"), "{told}");
    assert!(told.contains("`lacuna new plugin sampler walk --library walk`"), "{told}");
    assert_eq!(fs::read_dir(elsewhere.path()).unwrap().count(), 0);
}

#[test]
fn a_library_is_the_same_plugin_with_the_crates_that_it_needs() {
    let folder = tempfile::tempdir().unwrap();
    let (text, name) = trial("sampler");
    let (code, told) = ask(folder.path(), &["sampler", &name, "--library", "walk"]);
    assert_eq!(code, Some(0), "{told}");
    let written = fs::read_to_string(folder.path().join("walk/src/lib.rs")).unwrap();
    let inside = written.replace("use lacuna_plugin::lacuna;\n", "").replace(
        "lacuna_plugin::export! {\n    Sampler \"trial_sampler\" TrialSampler,\n}",
        "lacuna::register!(Sampler, \"trial_sampler\", TrialSampler);",
    );
    assert!(inside == text && written != text);
    let manifest = fs::read_to_string(folder.path().join("walk/Cargo.toml")).unwrap();
    let manifest: toml::Table = manifest.parse().unwrap();
    assert_eq!(manifest["lib"]["crate-type"][0].as_str(), Some("cdylib"));
    let crates: Vec<&String> = manifest["dependencies"].as_table().unwrap().keys().collect();
    assert_eq!(crates, ["lacuna-plugin", "schemars", "serde", "serde_json"]);
    // The folder is not inside a source tree: the SDK is that of the source from which the command was built.
    let sdk = manifest["dependencies"]["lacuna-plugin"]["path"].as_str().unwrap();
    assert_eq!(Path::new(sdk), root().join("sdk").canonicalize().unwrap());
}

/// Copies a folder without build products and results of runs.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    let built = from.join("Cargo.lock").exists();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let (path, name) = (entry.path(), entry.file_name());
        if name == "runs" || (built && [".git", "target"].iter().any(|skipped| name == *skipped)) {
            continue;
        }
        if path.is_dir() {
            copy(&path, &to.join(name));
        } else {
            fs::copy(&path, to.join(name)).unwrap();
        }
    }
}

/// Runs cargo in a copy of the source and returns its output.
fn cargo(tree: &Path, bless: bool, words: &[&str]) -> String {
    let begun = std::time::Instant::now();
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(words).current_dir(tree).env("CARGO_TARGET_DIR", tree.parent().unwrap());
    cargo.env_remove("LACUNA_SKELETONS").env("LACUNA_BLESS", if bless { "1" } else { "0" });
    let output = cargo.output().unwrap();
    let words = words.join(" ");
    println!("cargo {words}: {} s", begun.elapsed().as_secs());
    let [out, error] =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "cargo {words}\n{out}\n{error}");
    out
}

/// With `LACUNA_SKELETONS=1`: the whole procedure in a copy of the source. Only the command changes it; then the
/// plugins' own tests, the contracts, the generated pages and the rules of the source must pass.
///
/// It builds in `target/skeletons`, from scratch the first time.
#[test]
fn a_source_with_a_new_plugin_of_each_kind_passes_its_tests() {
    if std::env::var_os("LACUNA_SKELETONS").is_none_or(|value| value != "1") {
        println!("skipped: LACUNA_SKELETONS is not 1");
        return;
    }
    let tree = root().canonicalize().unwrap().join("target/skeletons/source");
    if tree.exists() {
        fs::remove_dir_all(&tree).unwrap();
    }
    copy(&root(), &tree);
    for (kind, _) in KINDS {
        let (code, told) = ask(&tree, &[kind, &trial(kind).1]);
        assert_eq!(code, Some(0), "{kind}: {told}");
    }
    cargo(&tree, false, &["fmt", "--all"]);
    let all = ["test", "--workspace", "--test", "all", "--"];
    cargo(&tree, true, &[&all[..], &["docs::"]].concat());
    cargo(&tree, false, &[&all[..], &["docs::", "tidy::"]].concat());
    cargo(&tree, false, &["test", "--workspace", "--test", "contracts"]);
    let told = cargo(&tree, false, &["test", "--workspace", "--lib", "--", "::trial_"]);
    for (kind, kinds) in KINDS {
        let name = trial(kind).1;
        let page = format!("docs/reference/{kind}.{name}.md");
        assert!(tree.join(&page).is_file(), "{page}");
        let passed = format!("test {kinds}::{name}::tests::it_keeps_the_contract ... ok");
        assert!(told.contains(&passed), "{passed}\n{told}");
    }
}
