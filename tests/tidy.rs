//! The source keeps to the house rules that a compiler does not check.

use std::fs;
use std::path::PathBuf;

use crate::quick::root;

/// Lines of the longest file.
const LIMIT: usize = 400;

/// Words that make a line that is not finished.
const UNFINISHED: [&str; 5] = ["TODO", "FIXME", "XXX", "todo!(", "unimplemented!("];

/// Beginnings of paths on somebody's machine.
const MACHINE: [&str; 6] = ["/home/", "/Users/", "/root/", "/work/", "/tmp/", "C:\\"];

/// Modules of the core from the top down: each may use those beside and below it.
///
/// A study chooses plugins and plugins complain about their part of a study; both stop with what a run
/// says, and expressions guess at names as a study does: these four are one layer.
const LAYERS: [&[&str]; 11] = [
    &["compare", "serve", "campaign"],
    &["stage"],
    &["contract"],
    &["report"],
    &["diagnose", "assess"],
    &["gap"],
    &["posterior"],
    &["plugin", "study", "run", "expression", "work"],
    &["data"],
    &["math"],
    &["linalg"],
];

/// Uses that go up a layer, with the reason.
const UPWARD: [(&str, &str, &str); 3] = [
    ("math/transform", "plugin", "what changes its coordinates is a `Target` too"),
    (
        "math/optimise",
        "plugin",
        "what is maximised is a `Target`, the density that samplers draw from",
    ),
    ("math/optimise", "run", "a density without a maximum stops the run"),
];

struct Source {
    /// From the root of the project, with forward slashes.
    name: String,
    text: String,
}

impl Source {
    fn is_test(&self) -> bool {
        self.name.starts_with("tests/")
            || self.name.contains("/tests/")
            || self.name.ends_with("/tests.rs")
    }

    /// The lines of the program itself with their numbers: no comments, nothing after `#[cfg(test)]` blocks begin.
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
        source.name.starts_with("core/src/plugin/abi/") || source.name == "sdk/src/lib.rs"
    };
    for source in rust().iter().filter(|source| !boundary(source)) {
        for (i, line) in source.program() {
            let words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
            if words.into_iter().any(|word| word == "unsafe") && source.name != "tests/tidy.rs" {
                found.push(format!("{}:{i}: {}", source.name, line.trim()));
            }
        }
    }
    none(&found, "`unsafe` outside `core/src/plugin/abi` and the macro of the SDK");
}

/// The names after `dependencies]` of a manifest.
fn dependencies(krate: &str) -> Vec<String> {
    let path = root().join(krate).join("Cargo.toml");
    let manifest: toml::Table = fs::read_to_string(path).unwrap().parse().unwrap();
    let table = manifest.get("dependencies").and_then(|d| d.as_table());
    table.map_or(Vec::new(), |table| table.keys().cloned().collect())
}

#[test]
fn crates_depend_one_way() {
    for (krate, above) in [
        ("core/linalg", &["lacuna", "lacuna-plugins", "lacuna-cli"][..]),
        ("core", &["lacuna-plugins", "lacuna-cli"]),
        ("plugins", &["lacuna-cli"]),
    ] {
        let found = dependencies(krate);
        let wrong: Vec<&String> = found.iter().filter(|d| above.contains(&d.as_str())).collect();
        assert!(wrong.is_empty(), "{krate} depends on {wrong:?}");
    }
}

/// The modules of the core that a line uses.
fn used(line: &str) -> impl Iterator<Item = &str> {
    line.split("crate::")
        .skip(1)
        .filter_map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next())
}

#[test]
fn modules_of_the_core_depend_one_way() {
    let rank = |module: &str| LAYERS.iter().position(|layer| layer.contains(&module));
    let mut found = Vec::new();
    for source in sources(&["core/src"], "rs").iter().filter(|source| !source.is_test()) {
        let inside = source.name.strip_prefix("core/src/").unwrap();
        let module = inside.split(['/', '.']).next().unwrap();
        if module == "lib" {
            continue;
        }
        let own = rank(module).unwrap_or_else(|| panic!("`{module}` is in no layer"));
        for (i, line) in source.program() {
            for other in used(line) {
                let allowed =
                    UPWARD.iter().any(|(from, to, _)| inside.starts_with(from) && *to == other);
                if rank(other).is_some_and(|other| other < own) && !allowed {
                    found.push(format!("{}:{i}: {}", source.name, line.trim()));
                }
            }
        }
    }
    none(&found, "uses that go up a layer");
}

/// Words of the engine's own that are also the name of a plugin.
const WORDS: [(&str, &str); 6] = [
    // The executor of a study that chooses none.
    ("core/src/study/resolve.rs", "local"),
    // The indices.
    ("core/src/report/summary/mod.rs", "sobol"),
    // What the parameters do from condition to condition.
    ("core/src/report/summary/gap.rs", "drift"),
    // The replicates' own.
    ("core/src/report/section/gap/tables.rs", "offset"),
    // The distribution.
    ("core/src/math/distribution/mod.rs", "student_t"),
    ("core/src/math/distribution/written.rs", "student_t"),
];

#[test]
fn the_core_names_no_plugin() {
    let kinds = lacuna::plugin::registry::kinds();
    let names: Vec<&str> =
        kinds.iter().flat_map(|kind| kind.plugins()).map(|plugin| plugin.name).collect();
    assert!(names.len() > 8, "{names:?}");
    let mut found = Vec::new();
    for source in sources(&["core/src"], "rs").iter().filter(|source| !source.is_test()) {
        for (i, line) in source.program() {
            let quoted =
                |name: &str| ["\"", "`"].iter().any(|q| line.contains(&format!("{q}{name}{q}")));
            for name in names.iter().filter(|name| quoted(name)) {
                if !WORDS.contains(&(&source.name, name)) {
                    found.push(format!("{}:{i}: {}", source.name, line.trim()));
                }
            }
        }
    }
    none(&found, "the core names plugins");
}
