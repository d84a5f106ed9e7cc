//! `extends = "base.toml"`: a study that states only its differences from another.
//!
//! A table with a header is merged key by key; a table in braces is one value and replaces the base's. Lists of named
//! tables (`[[parameter]]`) are merged by name; other arrays are replaced. A section that changes its `use` loses the
//! base's options of the old plugin; a section that is `false` is removed.

use std::path::{Path, PathBuf};

use lacuna::text::node::{Key, Node, Value};
use lacuna::text::problem::Problems;
use lacuna::text::read::read;
use lacuna::text::source::{Place, Sources};

/// The engine's own keys of a section, which stay when its plugin changes.
pub type CommonKeys<'a> = &'a dyn Fn(&str) -> &'static [&'static str];

/// Reads a study and all that it extends; `None` after reporting a file that cannot be read.
pub fn load(
    path: &Path,
    common: CommonKeys<'_>,
    sources: &mut Sources,
    problems: &mut Problems,
) -> Option<Node> {
    let mut loader = Loader { common, sources, problems, chain: Vec::new() };
    loader.file(path, None)
}

/// Reads a study from memory; the study that it extends is searched for beside `path`.
pub fn load_text(
    path: &Path,
    text: String,
    common: CommonKeys<'_>,
    sources: &mut Sources,
    problems: &mut Problems,
) -> Option<Node> {
    let mut loader = Loader { common, sources, problems, chain: vec![path.to_owned()] };
    loader.text(path, text)
}

struct Loader<'a> {
    common: CommonKeys<'a>,
    sources: &'a mut Sources,
    problems: &'a mut Problems,
    /// The files that led to this one, the study first.
    chain: Vec<PathBuf>,
}

impl Loader<'_> {
    /// `named` is the place that names the file; `None` for the study itself.
    fn file(&mut self, path: &Path, named: Option<&Place>) -> Option<Node> {
        let same = |other: &PathBuf| same_file(other, path);
        if self.chain.iter().any(same) {
            let mut chain: Vec<String> =
                self.chain.iter().map(|file| format!("`{}`", file.display())).collect();
            chain.push(format!("`{}`", path.display()));
            self.problems
                .report(named.cloned(), "a study cannot extend itself")
                .found(chain.join(" extends "))
                .help("take out one `extends` of the chain");
            return None;
        }
        match std::fs::read_to_string(path) {
            Ok(text) => {
                self.chain.push(path.to_owned());
                let node = self.text(path, text);
                self.chain.pop();
                node
            }
            Err(error) => {
                let message = format!("cannot read `{}`: {}", path.display(), reason(&error));
                self.problems.report(named.cloned(), message);
                None
            }
        }
    }

    fn text(&mut self, path: &Path, text: String) -> Option<Node> {
        let source = self.sources.add_file(path, text);
        let mut node = read(source, self.sources, self.problems)?;
        let Some((_, extends)) = node.remove("extends") else { return Some(node) };
        let Some(base) = extends.as_str() else {
            self.problems
                .report(Some(extends.place.clone()), "wrong value for `extends`")
                .expected("the path of a study, relative to this file")
                .found(extends.describe());
            return None;
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        let base = self.file(&folder.join(base), Some(&extends.place))?;
        Some(Merge { common: self.common, sources: self.sources }.study(base, node))
    }
}

fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => a == b,
    }
}

/// An input error without the number of the operating system.
fn reason(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
        std::io::ErrorKind::PermissionDenied => "permission denied".to_owned(),
        std::io::ErrorKind::InvalidData => "it is not UTF-8 text".to_owned(),
        std::io::ErrorKind::IsADirectory => "it is a folder".to_owned(),
        _ => error.to_string().to_lowercase(),
    }
}

/// Merging of a study with the one it extends.
pub(super) struct Merge<'a> {
    pub common: CommonKeys<'a>,
    pub sources: &'a Sources,
}

impl Merge<'_> {
    /// The base with the values of `over` in place of its own.
    fn study(&self, base: Node, over: Node) -> Node {
        let place = over.place.clone();
        let mut merged = Node { value: base.value, place };
        for (key, node) in into_entries(over) {
            let merged_node = match merged.take(&key.name) {
                Some(mut old) => {
                    if plugin(&old) != plugin(&node) && plugin(&node).is_some() {
                        self.drop_options(&key.name, &mut old);
                    }
                    self.value(old, node)
                }
                None => node,
            };
            merged.set(key, merged_node);
        }
        merged
    }

    fn value(&self, base: Node, over: Node) -> Node {
        match (&base.value, &over.value) {
            (Value::Table(_), Value::Table(_)) if !self.in_braces(&over) => {
                let mut merged = Node { value: base.value, place: over.place.clone() };
                for (key, node) in into_entries(over) {
                    let node = match merged.take(&key.name) {
                        Some(old) => self.value(old, node),
                        None => node,
                    };
                    merged.set(key, node);
                }
                merged
            }
            (Value::Array(old), Value::Array(new)) if all_named(old) && all_named(new) => {
                self.named(base, over)
            }
            _ => over,
        }
    }

    /// Merges tables with the same `name`, and appends new ones.
    fn named(&self, base: Node, over: Node) -> Node {
        let place = over.place.clone();
        let mut merged = into_elements(base);
        for element in into_elements(over) {
            let old = merged.iter().position(|old| old.name() == element.name());
            match old {
                Some(at) => {
                    let old = std::mem::replace(&mut merged[at], Node::table(place.clone()));
                    merged[at] = self.element(old, element);
                }
                None => merged.push(element),
            }
        }
        Node { value: Value::Array(merged), place }
    }

    /// An effect whose plugin changes keeps no options, like a section.
    fn element(&self, mut old: Node, element: Node) -> Node {
        if plugin(&element).is_some() && plugin(&element) != plugin(&old) {
            self.drop_options("", &mut old);
        }
        self.value(old, element)
    }

    /// Removes the options of a plugin from its section; the engine's keys stay.
    pub fn drop_options(&self, section: &str, node: &mut Node) {
        if plugin(node).is_none() {
            return;
        }
        let kept = (self.common)(section);
        if let Value::Table(entries) = &mut node.value {
            entries.retain(|(key, _)| kept.contains(&key.name.as_str()));
        }
    }

    fn in_braces(&self, node: &Node) -> bool {
        self.sources.text(&node.place).starts_with('{')
    }
}

fn plugin(section: &Node) -> Option<&str> {
    section.get("use").and_then(Node::as_str)
}

fn all_named(elements: &[Node]) -> bool {
    elements.iter().all(|element| element.name().is_some())
}

fn into_entries(node: Node) -> Vec<(Key, Node)> {
    match node.value {
        Value::Table(entries) => entries,
        _ => Vec::new(),
    }
}

fn into_elements(node: Node) -> Vec<Node> {
    match node.value {
        Value::Array(elements) => elements,
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests;
