//! An expression as read: a list of nodes in which parts stand before the whole.

use std::ops::Range;

use super::Fault;
use super::function::Function;
use super::operator::{Binary, Unary};
use super::parse;

/// The place of a node in its tree.
pub(super) type Id = usize;

/// An expression that has been read, its names not yet looked up.
///
/// Nodes are kept in one list, parts before the whole, so that no depth of nesting costs stack.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub text: String,
    /// The last one is the whole.
    pub nodes: Vec<Node>,
}

#[derive(Clone, Debug)]
pub(super) struct Node {
    pub kind: NodeKind,
    /// Its bytes of the text.
    pub span: Range<usize>,
}

#[derive(Clone, Debug)]
pub(super) enum NodeKind {
    /// A number and the bytes of its unit, braces left out.
    Number(f64, Option<Range<usize>>),
    Name(String),
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    Call(&'static Function, Vec<Id>),
    /// `name(x)`, a function that is given by a table.
    Table(String, Id),
    /// `base[index]`
    Index(Id, Id),
    /// `base[first:last]`
    Slice(Id, Option<Id>, Option<Id>),
    /// `[a, b, …]`
    List(Vec<Id>),
}

impl Tree {
    /// Reads an expression that may call these functions besides the language's own.
    pub fn parse(text: &str, tables: &[&str]) -> Result<Self, Fault> {
        Ok(Self { text: text.to_owned(), nodes: parse::nodes(text, tables)? })
    }

    /// The names that occur, in the order of the text, repetitions included.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.nodes.iter().filter_map(|node| match &node.kind {
            NodeKind::Name(name) => Some(name.as_str()),
            _ => None,
        })
    }
}
