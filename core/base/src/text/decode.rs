//! Decoding of [`Node`]s to typed options, with all problems of a section at once.
//!
//! Decoding stops at its first error, so it is repeated: each error is reported and the value at fault is left out,
//! until there are no further errors. A missing key is filled with a harmless value, so that the rest is still checked;
//! errors that only follow from such repairs are not reported.
//!
//! An error of a custom visitor or of `try_from` has the form `expected …, found …`, and may end in `; help: …`. A
//! number may be `inf` or `nan` only for a type that asks for any value (`deserialize_any`).

use std::collections::HashSet;

use serde::de::DeserializeOwned;

use super::nearest::{nearest, one_of};
use super::node::Node;
use super::problem::{Problem, Problems};

mod decoder;
mod fault;
mod fields;
mod hole;

use decoder::Decoder;
use fault::{Cause, Fault};

pub use fields::fields;

/// Decodes a table or value; `None` if there are problems, all of which have been reported.
pub fn decode<T: DeserializeOwned>(node: &Node, problems: &mut Problems) -> Option<T> {
    decode_beside(node, &[], problems)
}

/// Like [`decode`], but the keys `beside` are valid in this table too, although they have been removed from it.
pub fn decode_beside<T: DeserializeOwned>(
    node: &Node,
    beside: &[&str],
    problems: &mut Problems,
) -> Option<T> {
    let mut repairs = Repairs::default();
    let mut clean = true;
    // Every iteration leaves out a value or fills a key.
    for _ in 0..MOST {
        match T::deserialize(Decoder::new(node, &repairs)) {
            Ok(decoded) => return clean.then_some(decoded),
            Err(fault) => {
                clean = false;
                let fault = fault.inside(node, None);
                if !repairs.absorb(fault, node, beside, problems) {
                    return None;
                }
            }
        }
    }
    problems.report(None, format!("further problems here are not shown, after {MOST}"));
    None
}

/// Number of problems of one section after which it is not decoded again.
const MOST: usize = 500;

/// Values that are left out of a tree or filled in, so that decoding can continue.
#[derive(Default)]
struct Repairs {
    /// Values at fault.
    removed: HashSet<*const Node>,
    /// Values of unknown keys; nothing follows from their absence.
    ignored: HashSet<*const Node>,
    holes: Vec<(*const Node, String)>,
    /// Known keys that are present under a misspelt name.
    misspelt: Vec<(*const Node, String)>,
}

impl Repairs {
    fn is_removed(&self, node: &Node) -> bool {
        let node = std::ptr::from_ref(node);
        self.removed.contains(&node) || self.ignored.contains(&node)
    }

    fn holes_of(&self, node: &Node) -> impl Iterator<Item = &str> {
        let node = std::ptr::from_ref(node);
        self.holes.iter().filter(move |(owner, _)| *owner == node).map(|(_, key)| key.as_str())
    }

    /// Returns true if an error at `node` may follow from an earlier repair inside it.
    fn touched(&self, node: &Node) -> bool {
        let inside_tables = node.entries().iter().map(|(_, child)| child);
        let mut children = inside_tables.chain(node.elements());
        self.holes_of(node).next().is_some()
            || children.any(|child| {
                self.removed.contains(&std::ptr::from_ref(child)) || self.touched(child)
            })
    }

    /// Reports the fault and repairs the tree; returns false if nothing is left to decode.
    fn absorb(
        &mut self,
        fault: Fault,
        root: &Node,
        beside: &[&str],
        problems: &mut Problems,
    ) -> bool {
        let Some((culprit, parents)) = fault.trail.split_first() else { return false };
        let culprit = *culprit;
        let consequence = find(root, culprit).is_some_and(|node| self.touched(node));
        match &fault.cause {
            Cause::Missing(key) => {
                let removed = find(root, culprit)
                    .and_then(|table| table.get(key))
                    .is_some_and(|node| self.is_removed(node));
                let misspelt = self.misspelt.contains(&(culprit, key.clone()));
                if !removed && !misspelt {
                    problems.push(problem(&fault, problems, culprit == root, beside));
                }
                let hole = (culprit, key.clone());
                if !self.holes.contains(&hole) {
                    self.holes.push(hole);
                    return true;
                }
            }
            Cause::Hole => {}
            Cause::UnknownKey { key, known } => {
                let at_root = parents == [std::ptr::from_ref(root)];
                problems.push(problem(&fault, problems, at_root, beside));
                let meant = nearest(key, known.iter().map(String::as_str));
                let owner = parents.first().copied();
                self.misspelt.extend(owner.zip(meant.map(str::to_owned)));
                self.ignored.insert(culprit);
                return !parents.is_empty();
            }
            _ if consequence => {}
            _ => {
                problems.push(problem(&fault, problems, false, beside));
            }
        }
        self.removed.insert(culprit);
        !parents.is_empty()
    }
}

/// The node of the tree with this address.
fn find(node: &Node, address: *const Node) -> Option<&Node> {
    if std::ptr::eq(node, address) {
        return Some(node);
    }
    let inside_tables = node.entries().iter().map(|(_, child)| child);
    inside_tables.chain(node.elements()).find_map(|child| find(child, address))
}

/// The fault as a problem for the user.
fn problem(fault: &Fault, problems: &Problems, at_root: bool, beside: &[&str]) -> Problem {
    let path = fault.path();
    let beside = if at_root { beside } else { &[] };
    let mut problem = match &fault.cause {
        Cause::Missing(key) => Problem::new(format!("missing key `{key}`")),
        Cause::UnknownKey { key, known } => {
            let mut all: Vec<&str> = known.iter().map(String::as_str).collect();
            all.extend(beside.iter().filter(|name| !known.iter().any(|k| k == *name)));
            unknown("key", key, &all)
        }
        Cause::UnknownVariant { name, known } => {
            let known: Vec<&str> = known.iter().map(String::as_str).collect();
            unknown("choice", name, &known)
        }
        Cause::Wrong { message, expected, found, help } => {
            let named = format!("wrong value for `{path}`");
            let unnamed = if path.is_empty() { "wrong value".to_owned() } else { named };
            let mut problem = Problem::new(message.clone().unwrap_or(unnamed));
            problem.expected.clone_from(expected);
            problem.found.clone_from(found);
            problem.help.extend(help.clone());
            problem
        }
        Cause::Hole => Problem::new("nothing to decode"),
    };
    problem.place.clone_from(&fault.place);
    problem.path = problems.path(&path);
    problem
}

fn unknown(what: &str, name: &str, known: &[&str]) -> Problem {
    let mut problem = Problem::new(format!("unknown {what} `{name}`"));
    match known {
        [] => problem.expected(format!("no {what} here")),
        [only] => problem.expected(format!("`{only}`")),
        _ => problem.expected(format!("one of {}", one_of(known.iter().copied()))),
    };
    if let Some(near) = nearest(name, known.iter().copied()) {
        problem.help(format!("did you mean `{near}`?"));
    }
    problem
}

#[cfg(test)]
mod tests;
