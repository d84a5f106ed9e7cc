//! Lacuna's own source, into which a plugin is written.

use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the source that contains a folder.
pub fn around(folder: &Path) -> Option<PathBuf> {
    let is_tree = |folder: &&Path| {
        let manifest = fs::read_to_string(folder.join("plugins/Cargo.toml")).unwrap_or_default();
        folder.join("plugins/lib.rs").is_file() && manifest.contains("name = \"lacuna-plugins\"")
    };
    folder.ancestors().find(is_tree).map(Path::to_owned)
}

/// Name of the module that a line declares.
fn declared(line: &str) -> Option<&str> {
    let rest = line.strip_prefix("pub ").unwrap_or(line);
    rest.strip_prefix("mod ")?.strip_suffix(';')
}

/// A `mod.rs` with one more module in alphabetical order; `None` if it declares no modules or already has this one.
pub fn with_module(text: &str, name: &str) -> Option<String> {
    let lines: Vec<&str> = text.lines().collect();
    let first = lines.iter().position(|line| declared(line).is_some())?;
    if lines.iter().any(|line| declared(line) == Some(name)) {
        return None;
    }
    // Modules are declared in one block; anything after an empty line is something else.
    let end = first + lines[first..].iter().take_while(|line| !line.is_empty()).count();
    let after = (first..end).find(|&i| declared(lines[i]).is_some_and(|other| other > name));
    // An attribute belongs to the module declared below it.
    let attributes =
        |at: usize| lines[..at].iter().rev().take_while(|line| line.starts_with("#[")).count();
    let at = after.map_or(end, |at| at - attributes(at));
    let line = format!("pub mod {name};");
    let all = [&lines[..at], &[line.as_str()], &lines[at..]].concat();
    Some(all.join("\n") + "\n")
}
