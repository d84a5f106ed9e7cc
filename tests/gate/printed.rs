//! What is printed: the keys of `summary.json`, read from the source that writes them, so that a key which no run of the
//! tests makes is found too.

use std::collections::BTreeSet;
use std::fs;

use crate::quick::root;

/// The files that write keys.
const FOLDER: &str = "core/src/report/summary";

/// All keys as `file.function.key`, without the keys of tests.
pub fn keys() -> BTreeSet<String> {
    let mut keys = BTreeSet::new();
    let folder = root().join(FOLDER);
    for entry in fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        keys.extend(of_code(code).into_iter().map(|key| format!("{name}.{key}")));
    }
    keys
}

/// The keys of a source file as `function.key`: string literals before a colon (in `json!`), in the place of an index, and as
/// the first argument of a call.
fn of_code(code: &str) -> BTreeSet<String> {
    let mut keys = BTreeSet::new();
    let mut function = String::new();
    for line in code.lines().filter(|line| !line.trim_start().starts_with("//")) {
        if let Some((_, rest)) = line.split_once("fn ") {
            function = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        }
        for (at, literal) in literals(line) {
            let (before, after) =
                (line[..at].trim_end(), line[at + literal.len() + 2..].trim_start());
            let is_key = after.starts_with(':')
                || (before.ends_with('[') && after.starts_with(']'))
                || (before.ends_with('(') && after.starts_with(','));
            let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
            if is_key && !literal.is_empty() && literal.chars().all(plain) {
                keys.insert(format!("{function}.{literal}"));
            }
        }
    }
    keys
}

/// The string literals of a line with the places where they begin.
fn literals(line: &str) -> Vec<(usize, &str)> {
    let quotes: Vec<usize> = line.match_indices('"').map(|(at, _)| at).collect();
    quotes.chunks_exact(2).map(|pair| (pair[0], &line[pair[0] + 1..pair[1]])).collect()
}

#[test]
fn keys_are_found_wherever_they_are_written() {
    let code = r#"
        // "comment": 1
        fn one() { put("first", json!({ "second": 2, "third": "text" })); }
        fn two() { value["fourth"] = json!(4); format!("no {}", "key"); }
    "#;
    let expected = ["one.first", "one.second", "one.third", "two.fourth"];
    assert_eq!(of_code(code), expected.iter().map(ToString::to_string).collect());
}
