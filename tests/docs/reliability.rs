//! The page of promises names tests that exist, and every file with `unsafe`.

use std::collections::BTreeMap;
use std::fs;

use super::root;

const PAGE: &str = "docs/reliability.md";

/// Folders of the source, which is searched for `unsafe`.
const FOLDERS: [&str; 9] =
    ["core", "sdk", "um_bridge", "plugins", "cli", "examples", "bench", "python", "tests"];

fn page() -> String {
    fs::read_to_string(root().join(PAGE)).unwrap()
}

/// Tests that a line names: a file and a function, as `tests/kill.rs::name`.
fn named(line: &str) -> Vec<(String, String)> {
    let quoted = line.split('`').skip(1).step_by(2);
    let tests = quoted.filter_map(|text| text.split_once(".rs::"));
    tests.map(|(file, name)| (format!("{file}.rs"), name.to_owned())).collect()
}

#[test]
fn every_promise_names_tests_that_exist() {
    let page = page();
    let (mut wrong, mut promises) = (Vec::new(), 0);
    let mut in_table = false;
    for line in page.lines() {
        in_table = line.starts_with("| promise |") || (in_table && line.starts_with('|'));
        let tests = named(line);
        if in_table
            && line.ends_with('|')
            && !line.starts_with("| promise")
            && !line.starts_with("|---")
        {
            promises += 1;
            if tests.is_empty() {
                wrong.push(format!("no test: {line}"));
            }
        }
        for (file, name) in tests {
            let text = fs::read_to_string(root().join(&file)).unwrap_or_default();
            let is_test = text.split("#[test]").skip(1).any(|part| {
                let function = part.split("fn ").nth(1).unwrap_or_default();
                function.split('(').next() == Some(&name)
            });
            if !is_test {
                wrong.push(format!("{file} has no test `{name}`"));
            }
        }
    }
    assert!(promises > 30, "{promises} promises: the tables of {PAGE} were not found");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The word that is counted, which the source may not contain here.
const WORD: &str = concat!("un", "safe");

/// Words `unsafe` in the code of every file that has any.
fn counted() -> BTreeMap<String, usize> {
    let mut folders: Vec<_> = FOLDERS.iter().map(|folder| root().join(folder)).collect();
    let mut found = BTreeMap::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && path.file_name().is_some_and(|name| name != "target") {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let name = path.strip_prefix(root()).unwrap().display().to_string();
                // These tests search for the word.
                if ["tests/tidy.rs", "tests/docs/reliability.rs"].contains(&name.as_str()) {
                    continue;
                }
                let text = fs::read_to_string(&path).unwrap();
                let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
                let words = |line: &str| {
                    // A key word of the Content Security Policy of pages.
                    let line = line.replace("'unsafe-inline'", "");
                    let words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
                    words.filter(|word| *word == WORD).count()
                };
                let count: usize = code.map(words).sum();
                if count > 0 {
                    found.insert(name, count);
                }
            }
        }
    }
    found
}

#[test]
fn every_file_with_unsafe_is_listed() {
    let row = |line: &str| {
        let mut cells = line.strip_prefix("| `")?.split(" | ");
        let file = cells.next()?.strip_suffix('`')?;
        Some((file.to_owned(), cells.next()?.parse::<usize>().ok()?))
    };
    let page = page();
    let section = page.split("\n## Unsafe").nth(1).unwrap().split("\n## ").next().unwrap();
    let listed: BTreeMap<String, usize> = section.lines().filter_map(row).collect();
    let counted = counted();
    let lines: Vec<String> =
        counted.iter().map(|(file, count)| format!("| `{file}` | {count} |")).collect();
    assert!(listed == counted, "{PAGE} should list\n{}", lines.join("\n"));
}
