//! Rules of the source that a compiler does not check.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

use crate::quick::root;

/// Largest number of lines of a file.
const LIMIT: usize = 400;

/// Words that mark unfinished work.
const UNFINISHED: [&str; 5] = ["TODO", "FIXME", "XXX", "todo!(", "unimplemented!("];

/// Beginnings of paths on a particular machine.
const MACHINE: [&str; 6] = ["/home/", "/Users/", "/root/", "/work/", "/tmp/", "C:\\"];

/// Crates of this project that each crate may depend on.
const ARROWS: [(&str, &[&str]); 13] = [
    ("core/base", &[]),
    ("core/linalg", &["lacuna-base"]),
    ("core/optimise", &["lacuna-base", "lacuna-linalg"]),
    ("core/api", &["lacuna-base"]),
    ("core/abi", &["lacuna"]),
    ("core/run", &["lacuna"]),
    ("core/script", &["lacuna", "lacuna-abi", "lacuna-run"]),
    (
        "core/engine",
        &[
            "lacuna",
            "lacuna-abi",
            "lacuna-linalg",
            "lacuna-optimise",
            "lacuna-run",
            "lacuna-script",
        ],
    ),
    ("core/contract", &["lacuna", "lacuna-run"]),
    ("sdk", &["lacuna", "lacuna-abi", "lacuna-linalg"]),
    ("um_bridge", &[]),
    ("plugins", &["lacuna", "lacuna-linalg", "lacuna-optimise", "lacuna-run", "lacuna-um-bridge"]),
    (
        "cli",
        &[
            "lacuna",
            "lacuna-contract",
            "lacuna-engine",
            "lacuna-plugins",
            "lacuna-run",
            "lacuna-um-bridge",
        ],
    ),
];

struct Source {
    /// Path from the root of the project, with forward slashes.
    name: String,
    text: String,
}

impl Source {
    fn is_test(&self) -> bool {
        self.name.starts_with("tests/")
            || self.name.contains("/tests/")
            || self.name.ends_with("/tests.rs")
    }

    /// Lines of code with their numbers: without comments, up to the first `#[cfg(test)]` block.
    fn program(&self) -> impl Iterator<Item = (usize, &str)> {
        let in_tests = self.text.find("#[cfg(test)]\nmod tests {").unwrap_or(self.text.len());
        let lines = self.text[..in_tests].lines().enumerate().map(|(i, line)| (i + 1, line));
        lines.filter(|(_, line)| !line.trim_start().starts_with("//"))
    }
}

/// All files of some folders with this extension.
fn sources(folders: &[&str], extension: &str) -> Vec<Source> {
    let mut paths: Vec<PathBuf> = folders.iter().map(|folder| root().join(folder)).collect();
    let mut found = Vec::new();
    while let Some(path) = paths.pop() {
        if path.is_dir() {
            paths.extend(fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path()));
        } else if path.extension().is_some_and(|e| e == extension) {
            let name = path.strip_prefix(root()).unwrap().display().to_string().replace('\\', "/");
            found.push(Source { name, text: fs::read_to_string(&path).unwrap() });
        }
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

const FOLDERS: [&str; 8] =
    ["core", "sdk", "um_bridge", "plugins", "cli", "tests", "examples", "bench"];

fn rust() -> Vec<Source> {
    let sources = sources(&FOLDERS, "rs");
    assert!(sources.len() > 150, "{} files: the folders of the source have moved", sources.len());
    sources
}

fn none(found: &[String], rule: &str) {
    assert!(found.is_empty(), "{rule}:\n{}", found.join("\n"));
}

#[test]
fn no_file_is_long() {
    let lines = |text: &str| text.lines().count();
    let long = rust().into_iter().filter(|source| lines(&source.text) > LIMIT);
    let long: Vec<String> =
        long.map(|source| format!("{}: {} lines", source.name, lines(&source.text))).collect();
    none(&long, "files above 400 lines want to be two files");
}

#[test]
fn nothing_is_unfinished_or_of_one_machine() {
    let mut found = Vec::new();
    for source in rust() {
        if source.name == "tests/tidy.rs" {
            continue;
        }
        for (i, line) in source.text.lines().enumerate() {
            if UNFINISHED.iter().chain(&MACHINE).any(|word| line.contains(word)) {
                found.push(format!("{}:{}: {}", source.name, i + 1, line.trim()));
            }
        }
    }
    for extension in ["toml", "md", "json", "py"] {
        for source in sources(&["configs", "docs", "tests/problems", "cli", ".ci"], extension) {
            for (i, line) in source.text.lines().enumerate() {
                if MACHINE.iter().any(|path| line.contains(path)) {
                    found.push(format!("{}:{}: {}", source.name, i + 1, line.trim()));
                }
            }
        }
    }
    none(&found, "unfinished, or with a path of one machine");
}

#[test]
fn nothing_is_unsafe() {
    let mut found = Vec::new();
    let boundary = |source: &&Source| {
        ["core/abi/", "core/engine/src/host/", "sdk/src/"]
            .iter()
            .any(|folder| source.name.starts_with(folder))
    };
    for source in rust().iter().filter(|source| !boundary(source)) {
        for (i, line) in source.program() {
            // A key word of the Content Security Policy of pages.
            let line = line.replace("'unsafe-inline'", "");
            let words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
            if words.into_iter().any(|word| word == "unsafe") && source.name != "tests/tidy.rs" {
                found.push(format!("{}:{i}: {}", source.name, line.trim()));
            }
        }
    }
    none(&found, "`unsafe` outside `core/abi`, `core/engine/src/host` and the SDK");
}

/// Names of the dependencies of a manifest.
fn dependencies(krate: &str) -> Vec<String> {
    let path = root().join(krate).join("Cargo.toml");
    let manifest: toml::Table = fs::read_to_string(path).unwrap().parse().unwrap();
    let table = manifest.get("dependencies").and_then(|d| d.as_table());
    table.map_or(Vec::new(), |table| table.keys().cloned().collect())
}

#[test]
fn crates_use_those_below_them_alone() {
    for (krate, below) in ARROWS {
        let own = |name: &String| name == "lacuna" || name.starts_with("lacuna-");
        let found: Vec<String> = dependencies(krate).into_iter().filter(own).collect();
        let wrong: Vec<&String> = found.iter().filter(|d| !below.contains(&d.as_str())).collect();
        assert!(wrong.is_empty(), "{krate} depends on {wrong:?}");
    }
    // The crates of a plugin library build without the engine, and without faer unless it is requested.
    let sdk: toml::Table =
        fs::read_to_string(root().join("sdk/Cargo.toml")).unwrap().parse().unwrap();
    assert_eq!(sdk["dependencies"]["lacuna-linalg"]["optional"].as_bool(), Some(true));
}

/// Names directly below a module, such as `crate::`, that a file uses.
fn used(source: &Source, module: &str) -> Vec<String> {
    let text: String = source.program().map(|(_, line)| format!("{line}\n")).collect();
    let word = |rest: &str| {
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        rest[..end].to_owned()
    };
    let names = |rest: &str| match rest.strip_prefix('{') {
        Some(list) => {
            let end = list.find('}').unwrap_or(list.len());
            list[..end].split(',').map(|name| word(name.trim())).collect()
        }
        None => vec![word(rest)],
    };
    text.split(module).skip(1).flat_map(names).collect()
}

/// Dependencies between the modules of a crate, by the module that uses the others. A name that the root of the crate
/// re-exports stands for its module.
fn uses(krate: &str) -> BTreeMap<String, BTreeSet<String>> {
    let folder = format!("{krate}/src/");
    let root = fs::read_to_string(root().join(&folder).join("lib.rs")).unwrap();
    let exports = root.lines().filter_map(|line| line.strip_prefix("pub use ")?.split_once("::"));
    let module_of = |name: String| {
        let words = |text: &str| text.split(['{', '}', ',', ';', ' ']).any(|word| word == name);
        let found = exports.clone().find(|(_, exported)| words(exported));
        found.map_or(name.clone(), |(module, _)| module.to_owned())
    };
    let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for source in sources(&[&folder], "rs").iter().filter(|source| !source.is_test()) {
        let inside = source.name.strip_prefix(&folder).unwrap();
        let module = inside.split(['/', '.']).next().unwrap().to_owned();
        let others =
            used(source, "crate::").into_iter().map(module_of).filter(|other| *other != module);
        let others: Vec<String> = others.collect();
        all.entry(module).or_default().extend(others);
    }
    all.remove("lib");
    all
}

/// Circles among modules: repeatedly removes a module that uses none of the remaining ones; a circle is never removed.
fn circles(mut left: BTreeMap<String, BTreeSet<String>>) -> BTreeMap<String, BTreeSet<String>> {
    while let Some(bottom) =
        left.iter().find(|(_, others)| !others.iter().any(|o| left.contains_key(o)))
    {
        let bottom = bottom.0.clone();
        left.remove(&bottom);
    }
    left
}

#[test]
fn modules_of_a_crate_use_each_other_one_way() {
    for krate in ARROWS.iter().map(|(krate, _)| krate).filter(|krate| krate.starts_with("core/")) {
        let left = circles(uses(krate));
        assert!(left.is_empty(), "modules of {krate} that use each other in a circle: {left:?}");
    }
}

#[test]
fn parts_of_the_gap_workflow_use_each_other_one_way() {
    let folder = "core/engine/src/gap/";
    let mut parts: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for source in sources(&[folder], "rs").iter().filter(|source| !source.is_test()) {
        let inside: Vec<&str> = source.name[folder.len()..].split(['/', '.']).collect();
        let part = inside[0].to_owned();
        // The module itself, and the experiments that tests make.
        if ["mod", "testing"].contains(&inside[0]) {
            continue;
        }
        let mut others = used(source, "crate::gap::");
        if inside.len() == 2 || inside[1] == "mod" {
            others.extend(used(source, "super::"));
        }
        parts.entry(part.clone()).or_default().extend(others.into_iter().filter(|o| *o != part));
    }
    assert!(parts.len() > 10, "{parts:?}");
    let left = circles(parts);
    assert!(left.is_empty(), "parts of the gap that use each other in a circle: {left:?}");
}

/// A doc comment begins with its subject: words such as these begin a riddle.
#[test]
fn doc_comments_begin_with_their_subject() {
    let riddles = ["What", "Where", "Whether", "Its"];
    let mut wrong = Vec::new();
    for source in sources(&["core", "plugins", "cli", "sdk", "um_bridge", "tests", "bench"], "rs") {
        let mut in_comment = false;
        for (i, line) in source.text.lines().enumerate() {
            let line = line.trim_start();
            let text = line.strip_prefix("///").or_else(|| line.strip_prefix("//!"));
            let first = text.and_then(|text| text.split_whitespace().next()).unwrap_or_default();
            if text.is_some() && !in_comment && riddles.contains(&first) {
                wrong.push(format!("{}:{}: {line}", source.name, i + 1));
            }
            in_comment = text.is_some();
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Returns the examples in doc comments that rustdoc would run: blocks of code that name no other language.
fn examples(source: &Source) -> Vec<String> {
    let (mut found, mut is_open) = (Vec::new(), false);
    for (i, line) in source.text.lines().enumerate() {
        let line = line.trim_start();
        let text = line.strip_prefix("///").or_else(|| line.strip_prefix("//!"));
        let Some(language) = text.and_then(|text| text.trim_start().strip_prefix("```")) else {
            is_open &= text.is_some();
            continue;
        };
        if !is_open && ["", "rust", "should_panic", "no_run"].contains(&language) {
            found.push(format!("{}:{}: {line}", source.name, i + 1));
        }
        is_open = !is_open;
    }
    found
}

/// A crate without tests of its documentation has no example that they would run.
#[test]
fn no_example_is_left_unrun() {
    let is_without = |folder: &&str| {
        let manifest = fs::read_to_string(root().join(folder).join("Cargo.toml")).unwrap();
        manifest.contains("doctest = false")
    };
    let folders: Vec<&str> = ARROWS.iter().map(|(folder, _)| *folder).filter(is_without).collect();
    assert!(folders.contains(&"core/engine"), "{folders:?}");
    let found: Vec<String> = sources(&folders, "rs").iter().flat_map(examples).collect();
    none(&found, "examples that no test runs");
    let run: Vec<String> = sources(&["core/base"], "rs").iter().flat_map(examples).collect();
    assert!(!run.is_empty(), "the rule finds no example at all");
}

/// Words of the engine that are also names of plugins.
const WORDS: [(&str, &str); 9] = [
    // The default executor.
    ("core/engine/src/study/table.rs", "local"),
    // Offsets of replicates.
    ("core/engine/src/gap/report/tables.rs", "offset"),
    // Copulas.
    ("core/engine/src/study/dependence/groups.rs", "student_t"),
    ("core/engine/src/study/dependence/keys.rs", "gaussian"),
    ("core/engine/src/study/dependence/keys.rs", "student_t"),
    // Populations.
    ("core/engine/src/study/hierarchy/keys.rs", "student_t"),
    ("core/engine/src/report/summary/populations.rs", "student_t"),
    // Distribution.
    ("core/base/src/math/distribution/mod.rs", "student_t"),
    ("core/base/src/math/distribution/written.rs", "student_t"),
];

/// Names of quantities that are words of statistics and of JSON Schema.
const STATISTICS: [&str; 4] = ["mean", "minimum", "maximum", "band"];

#[test]
fn the_core_names_no_plugin() {
    let kinds = lacuna::plugin::registry::kinds();
    let names: Vec<&str> =
        kinds.iter().flat_map(|kind| kind.plugins()).map(|plugin| plugin.name).collect();
    assert!(names.len() > 8, "{names:?}");
    let mut found = Vec::new();
    for source in sources(&["core"], "rs").iter().filter(|source| !source.is_test()) {
        for (i, line) in source.program() {
            let quoted =
                |name: &str| ["\"", "`"].iter().any(|q| line.contains(&format!("{q}{name}{q}")));
            let named = names.iter().filter(|name| quoted(name) && !STATISTICS.contains(name));
            for name in named {
                if !WORDS.contains(&(&source.name, name)) {
                    found.push(format!("{}:{i}: {}", source.name, line.trim()));
                }
            }
        }
    }
    none(&found, "the core names plugins");
}
